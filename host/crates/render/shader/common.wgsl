// Prepended to every shader. The struct is `Uniforms` of src/uniforms.rs, field by field.
struct Uniforms {
    clip_from_world: mat4x4f,
    eye: vec4f,              // xyz
    ray_forward: vec4f,      // xyz: into the picture
    ray_right: vec4f,        // xyz: scaled so that forward ± right is the picture's edge
    ray_up: vec4f,           // xyz: the same, upwards
    viewport: vec4f,         // width, height, 1 / width, 1 / height (pixels)
    ground: vec4f,           // height, grid cell, radius of the character, 1 if the eye is above the floor
    ground_center: vec4f,    // x, z of the pool of light
    shadow: vec4f,           // x, z of the map's centre, half its side, strength
    backdrop_top: vec4f,     // colours are linear
    backdrop_horizon: vec4f,
    floor: vec4f,
    grid: vec4f,
    highlight: vec4f,
    sky: vec4f,
    bounce: vec4f,
    key_direction: vec4f,    // xyz: unit, towards the light
    key_color: vec4f,
    fill_direction: vec4f,
    fill_color: vec4f,
    rim_direction: vec4f,
    rim_color: vec4f,
}

@group(0) @binding(0) var<uniform> u: Uniforms;
