// The character. Twin: src/cpu/mesh.rs.
// The struct is `MaterialUniforms` of src/material.rs, field by field.
struct Material {
    base_color: vec4f,       // linear red, green, blue; opacity
    surface: vec4f,          // metallic, roughness, scale of the normal map, least opacity that is drawn (-1: any)
    emissive: vec4f,         // xyz
    flags: vec4f,            // 1 where it is unlit, has a normal map, shows no backs, is blended
}

@group(1) @binding(0) var base_color_map: texture_2d<f32>;
@group(1) @binding(1) var metallic_roughness_map: texture_2d<f32>;
@group(1) @binding(2) var normal_map: texture_2d<f32>;
@group(1) @binding(3) var emissive_map: texture_2d<f32>;
@group(1) @binding(4) var base_color_sampler: sampler;
@group(1) @binding(5) var metallic_roughness_sampler: sampler;
@group(1) @binding(6) var normal_sampler: sampler;
@group(1) @binding(7) var emissive_sampler: sampler;
@group(1) @binding(8) var<uniform> material: Material;

struct Surface {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) highlight: f32,
    @location(4) color: vec4f,
}

@vertex
fn vertex(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) highlight: f32,
    @location(4) color: vec4f,
) -> Surface {
    return Surface(u.clip_from_world * vec4f(position, 1.0), position, normal, uv, highlight, color);
}

const PI = 3.14159265;
// The lights are softboxes: added to the roughness that their highlights are computed with (Karis 2013).
const LIGHT_SIZE = 0.2;

// Zero stays zero.
fn unit(v: vec3f) -> vec3f {
    return v * inverseSqrt(max(dot(v, v), 1e-36));
}

// Lambert's cosine, extended a little past the terminator, as with light from a softbox.
fn wrapped(cosine: f32, wrap: f32) -> f32 {
    return saturate((cosine + wrap) / (1.0 + wrap));
}

// Trowbridge and Reitz's distribution (GGX) times π, with Smith's shadowing by Hammon's approximation and Schlick's
// Fresnel term. `alpha`: the roughness squared.
fn gloss(towards: vec3f, light: vec3f, normal: vec3f, to_eye: vec3f, reflectance: vec3f, alpha: f32) -> vec3f {
    let half_way = unit(to_eye + towards);
    let lit = saturate(dot(normal, towards));
    let facing = saturate(dot(normal, to_eye));
    let wide = min(alpha + LIGHT_SIZE, 1.0);
    let peak = saturate(dot(normal, half_way));
    let spread = peak * peak * (wide * wide - 1.0) + 1.0;
    let shadowing = 0.5 / max(mix(2.0 * lit * facing, lit + facing, wide), 1e-4);
    let fresnel = reflectance + (1.0 - reflectance) * pow(1.0 - saturate(dot(to_eye, half_way)), 5.0);
    return light * fresnel * (wide * wide / (spread * spread) * shadowing * lit);
}

// How much of the surroundings is reflected (Karis's fit for mobile devices, 2014).
fn reflected(reflectance: vec3f, roughness: f32, facing: f32) -> vec3f {
    let fit = roughness * vec4f(-1.0, -0.0275, -0.572, 0.022) + vec4f(1.0, 0.0425, 1.04, -0.04);
    let edge = min(fit.x * fit.x, exp2(-9.28 * facing)) * fit.x + fit.y;
    return reflectance * (fit.z - 1.04 * edge) + (fit.w + 1.04 * edge);
}

// The studio that smooth surfaces reflect: a dark floor, a horizon, a softbox overhead; rough surfaces see it blurred.
fn surroundings(towards: vec3f, roughness: f32) -> vec3f {
    let blur = 0.1 + 0.6 * roughness;
    let room = mix(u.bounce.rgb, u.sky.rgb, smoothstep(-blur, blur, towards.y));
    return room + u.sky.rgb * (4.0 * smoothstep(0.25 - blur, 0.75 + blur, towards.y));
}

@fragment
fn fragment(surface: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    let base_texel = textureSample(base_color_map, base_color_sampler, surface.uv);
    let surface_texel = textureSample(metallic_roughness_map, metallic_roughness_sampler, surface.uv);
    let normal_texel = textureSample(normal_map, normal_sampler, surface.uv).xyz;
    let emissive_texel = textureSample(emissive_map, emissive_sampler, surface.uv).rgb;
    let right = dpdx(surface.world);
    let down = dpdy(surface.world);
    let uv_right = dpdx(surface.uv);
    let uv_down = dpdy(surface.uv);

    let base = material.base_color * surface.color * base_texel;
    if base.a < material.surface.w || (material.flags.z > 0.5 && !front) {
        discard;
    }
    let opacity = select(1.0, base.a, material.flags.w > 0.5);
    let tinted = mix(base.rgb, u.highlight.rgb, saturate(surface.highlight) * 0.75);
    let emitted = material.emissive.rgb * emissive_texel;
    if material.flags.x > 0.5 {
        return vec4f(tinted + emitted, opacity);
    }

    let smooth_normal = unit(surface.normal);
    var shading = smooth_normal;
    if material.flags.y > 0.5 {
        // Where texture coordinates increase on the surface; the second one increases downwards in the image.
        let turn = sign(uv_right.x * uv_down.y - uv_down.x * uv_right.y);
        let across = (right * uv_down.y - down * uv_right.y) * turn;
        let up = (right * uv_down.x - down * uv_right.x) * turn;
        let tangent = unit(across - smooth_normal * dot(smooth_normal, across));
        let bitangent = unit(up - smooth_normal * dot(smooth_normal, up));
        let tilt = (normal_texel * 2.0 - 1.0) * vec3f(material.surface.zz, 1.0);
        shading = unit(tangent * tilt.x + bitangent * tilt.y + smooth_normal * tilt.z);
    }
    let to_eye = unit(u.eye.xyz - surface.world);
    // The visible side determines which way the normal points, however the triangle is wound.
    let seen_side = cross(down, right);
    let normal = select(-shading, shading, dot(smooth_normal, seen_side) >= 0.0);
    let facing = saturate(dot(normal, to_eye));

    let metallic = saturate(material.surface.x * surface_texel.b);
    let roughness = clamp(material.surface.y * surface_texel.g, 0.05, 1.0);
    let alpha = roughness * roughness;
    let reflectance = mix(vec3f(0.04), tinted, metallic);
    let diffuse = tinted * (1.0 - metallic);
    let above = saturate((surface.world.y - u.ground.x) / (0.5 * u.ground.z));
    let openness = mix(1.0, mix(0.45, 1.0, above), saturate(0.5 - 0.5 * normal.y));
    let ambient = mix(u.bounce.rgb, u.sky.rgb, 0.5 + 0.5 * normal.y);
    let key = wrapped(dot(normal, u.key_direction.xyz), 0.05);
    let fill = wrapped(dot(normal, u.fill_direction.xyz), 0.45);
    let edge = pow(1.0 - facing, 3.0);
    let rim = edge * saturate(0.35 + 0.65 * dot(normal, u.rim_direction.xyz));
    let mirrored = reflect(-to_eye, normal);
    let light = diffuse * (ambient * openness + u.key_color.rgb * key + u.fill_color.rgb * fill)
        + reflected(reflectance, roughness, facing) * surroundings(mirrored, roughness) * openness
        + gloss(u.key_direction.xyz, u.key_color.rgb, normal, to_eye, reflectance, alpha)
        + gloss(u.fill_direction.xyz, u.fill_color.rgb, normal, to_eye, reflectance, alpha)
        + gloss(u.rim_direction.xyz, u.rim_color.rgb, normal, to_eye, reflectance, alpha) * metallic
        + u.rim_color.rgb * rim;
    return vec4f(light + emitted, opacity);
}
