// The character. Twin: src/cpu/mesh.rs.
@group(1) @binding(0) var base_color_texture: texture_2d<f32>;
@group(1) @binding(1) var repeating: sampler;
@group(1) @binding(2) var<uniform> base_color: vec4f; // xyz, linear

struct Surface {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) highlight: f32,
    @location(4) color: vec3f,
}

@vertex
fn vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) highlight: f32,
    @location(4) color: vec3f,
) -> Surface {
    return Surface(u.clip_from_world * vec4f(position, 1.0), position, normal, uv, highlight, color);
}

// Lambert's cosine, extended a little past the terminator, as with light from a softbox.
fn wrapped(cosine: f32, wrap: f32) -> f32 {
    return saturate((cosine + wrap) / (1.0 + wrap));
}

fn specular(normal: vec3f, to_eye: vec3f, to_light: vec3f) -> f32 {
    let half_way = normalize(to_eye + to_light);
    let fresnel = 0.04 + 0.96 * pow(1.0 - saturate(dot(to_eye, half_way)), 5.0);
    return fresnel * 1.3 * pow(saturate(dot(normal, half_way)), 22.0) * saturate(dot(normal, to_light));
}

@fragment
fn fragment(surface: Surface) -> @location(0) vec4f {
    let texel = textureSample(base_color_texture, repeating, surface.uv).rgb;
    let base = mix(base_color.rgb * surface.color * texel, u.highlight.rgb, saturate(surface.highlight) * 0.75);
    let to_eye = normalize(u.eye.xyz - surface.world);
    let shading = normalize(surface.normal);
    // The visible side determines which way the normal points, however the triangle is wound.
    let seen_side = cross(dpdy(surface.world), dpdx(surface.world));
    let normal = select(-shading, shading, dot(shading, seen_side) >= 0.0);
    let facing = saturate(dot(normal, to_eye));
    let above = saturate((surface.world.y - u.ground.x) / (0.5 * u.ground.z));
    let openness = mix(1.0, mix(0.45, 1.0, above), saturate(0.5 - 0.5 * normal.y));
    let ambient = mix(u.bounce.rgb, u.sky.rgb, 0.5 + 0.5 * normal.y) * openness;
    let key = wrapped(dot(normal, u.key_direction.xyz), 0.05);
    let fill = wrapped(dot(normal, u.fill_direction.xyz), 0.45);
    let edge = pow(1.0 - facing, 3.0);
    let rim = edge * saturate(0.35 + 0.65 * dot(normal, u.rim_direction.xyz));
    let diffuse = base * (ambient + u.key_color.rgb * key + u.fill_color.rgb * fill);
    let gloss = u.key_color.rgb * specular(normal, to_eye, u.key_direction.xyz);
    return vec4f(diffuse + gloss + u.rim_color.rgb * rim, 1.0);
}
