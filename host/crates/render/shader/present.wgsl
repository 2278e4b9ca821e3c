// Linear light to the screen: soft shoulder, sRGB curve, dither. Twin: src/cpu/present.rs.
@group(0) @binding(0) var linear_light: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

struct Screen {
    @builtin(position) position: vec4f,
    @location(0) uv: vec2f,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Screen {
    let corner = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    return Screen(vec4f(corner * 2.0 - 1.0, 0.0, 1.0), vec2f(corner.x, 1.0 - corner.y));
}

// Leaves colours up to 0.7 alone and compresses anything brighter towards 1.
fn shoulder(light: vec3f) -> vec3f {
    let bent = 1.0 - 0.3 * exp((0.7 - light) / 0.3);
    return select(light, bent, light > vec3f(0.7));
}

fn srgb_from_linear(light: vec3f) -> vec3f {
    let curve = 1.055 * pow(max(light, vec3f(0.0031308)), vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, light * 12.92, light <= vec3f(0.0031308));
}

// Interleaved gradient noise (Jimenez 2014), half a step to either side: prevents banding in dark gradients.
fn dither(pixel: vec2f) -> f32 {
    return (fract(52.9829189 * fract(dot(pixel, vec2f(0.06711056, 0.00583715)))) - 0.5) / 255.0;
}

fn present(screen: Screen) -> vec3f {
    let light = textureSampleLevel(linear_light, smooth_sampler, screen.uv, 0.0).rgb;
    return srgb_from_linear(shoulder(light)) + dither(screen.position.xy);
}

@fragment
fn fragment(screen: Screen) -> @location(0) vec4f {
    return vec4f(present(screen), 1.0);
}

// For targets that encode sRGB themselves.
@fragment
fn fragment_for_srgb_target(screen: Screen) -> @location(0) vec4f {
    let encoded = max(present(screen), vec3f(0.0));
    let light = select(pow((encoded + 0.055) / 1.055, vec3f(2.4)), encoded / 12.92, encoded <= vec3f(0.04045));
    return vec4f(light, 1.0);
}
