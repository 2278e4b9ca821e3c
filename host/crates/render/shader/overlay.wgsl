// Bones seen through the skin. Twin: src/cpu/overlay.rs.
struct Shape {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) color: vec4f,
}

@vertex
fn vertex(@location(0) position: vec3f, @location(1) normal: vec3f, @location(2) color: vec4f) -> Shape {
    let to_eye = normalize(u.eye.xyz - position);
    let shade = 0.4 + 0.6 * saturate(dot(normal, to_eye));
    return Shape(u.clip_from_world * vec4f(position, 1.0), vec4f(color.rgb * shade, color.a));
}

@fragment
fn fragment(shape: Shape) -> @location(0) vec4f {
    return shape.color;
}
