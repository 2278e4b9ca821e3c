// Backdrop, floor, grid and contact shadow. Twin: src/cpu/background.rs.
@group(0) @binding(1) var shadow_map: texture_2d<f32>;
@group(0) @binding(2) var clamped: sampler;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    let corner = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4f(corner * 2.0 - 1.0, 1.0, 1.0);
}

fn ray_through(pixel: vec2f) -> vec3f {
    let x = pixel.x * u.viewport.z * 2.0 - 1.0;
    let y = 1.0 - pixel.y * u.viewport.w * 2.0;
    return u.ray_forward.xyz + u.ray_right.xyz * x + u.ray_up.xyz * y;
}

// x, z on the floor, relative to the centre of the pool of light, in units of the character's radius.
fn floor_point(ray: vec3f) -> vec2f {
    let travel = (u.ground.x - u.eye.y) / ray.y;
    return u.eye.xz + ray.xz * travel;
}

fn grid_lines(point: vec2f, across: vec2f, cell: f32) -> f32 {
    let coordinate = point / cell;
    let pixel = across / cell;
    let distance = abs(fract(coordinate - 0.5) - 0.5);
    let line = 1.0 - smoothstep(vec2f(0.0), max(pixel * 1.3, vec2f(1e-6)), distance);
    let calm = 1.0 - smoothstep(vec2f(0.1), vec2f(0.4), pixel);
    return max(line.x * calm.x, line.y * calm.y);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = position.xy;
    let ray = ray_through(pixel);
    let elevation = normalize(ray).y;
    var color = mix(u.backdrop_horizon.rgb, u.backdrop_top.rgb, smoothstep(0.0, 0.45, elevation));
    if u.ground.w > 0.5 && elevation < -1e-4 {
        let point = floor_point(ray);
        let away = (point - u.ground_center.xy) / u.ground.z;
        let falloff = dot(away, away);
        let pool = exp(-falloff / 5.0);
        color = mix(u.backdrop_horizon.rgb, u.floor.rgb * (1.0 + 0.9 * exp(-falloff / 1.1)), pool);
        let right = ray_through(pixel + vec2f(1.0, 0.0));
        let down = ray_through(pixel + vec2f(0.0, 1.0));
        if right.y < 0.0 && down.y < 0.0 {
            let across = abs(floor_point(right) - point) + abs(floor_point(down) - point);
            let minor = grid_lines(point, across, u.ground.y);
            let major = grid_lines(point, across, u.ground.y * 5.0);
            let strength = max(minor * 0.22, major * 0.42) * exp(-falloff / 7.0);
            color = mix(color, u.grid.rgb, strength);
        }
        let texel = (point - u.shadow.xy) / (2.0 * u.shadow.z) + 0.5;
        if all(texel > vec2f(0.0)) && all(texel < vec2f(1.0)) {
            color *= 1.0 - u.shadow.w * textureSampleLevel(shadow_map, clamped, texel, 0.0).r;
        }
    }
    let corner = (pixel * u.viewport.zw - 0.5) * 1.25;
    color *= 1.0 - 0.45 * dot(corner, corner);
    return vec4f(color, 1.0);
}
