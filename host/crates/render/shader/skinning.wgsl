// Shared by the skinning kernels: one invocation per vertex, one row of the grid per pose.

struct Sizes { vertices: u32, bones: u32, per_vertex: u32, poses: u32 }
struct Rest { position: vec3<f32>, normal: vec3<f32> }
// Heaviest first; `end`: how far towards the bone's end.
struct Influence { bone: u32, weight: f32, end: f32 }

@group(0) @binding(0) var<uniform> sizes: Sizes;
@group(0) @binding(1) var<storage, read> rest: array<Rest>;
@group(0) @binding(2) var<storage, read> influences: array<Influence>;
// Pose after pose, bone after bone.
@group(0) @binding(3) var<storage, read> bones: array<vec4<f32>>;
// All positions, pose after pose; then all normals.
@group(0) @binding(4) var<storage, read_write> posed: array<f32>;

// A squared length: below it, a map flattens the surface and the rest normal is kept.
const FLAT: f32 = 4e-12;

fn write_posed(at: vec2<u32>, position: vec3<f32>, normal: vec3<f32>) {
    let first = 3u * (at.y * sizes.vertices + at.x);
    let normals = 3u * sizes.poses * sizes.vertices;
    for (var axis = 0u; axis < 3u; axis++) {
        posed[first + axis] = position[axis];
        posed[normals + first + axis] = normal[axis];
    }
}

// A normal transformed by the cofactors of the map with these rows.
fn turned_by_map(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let longest = max(max(max(abs(x.x), abs(x.y)), abs(x.z)),
        max(max(max(abs(y.x), abs(y.y)), abs(y.z)), max(max(abs(z.x), abs(z.y)), abs(z.z))));
    // A zero map: the code below must not divide by zeros.
    if !(longest > 0.0) { return normal; }
    let a = x / longest;
    let b = y / longest;
    let c = z / longest;
    let turned = vec3(dot(normal, cross(b, c)), dot(normal, cross(c, a)), dot(normal, cross(a, b)));
    let squared = dot(turned, turned);
    if squared > FLAT { return turned / sqrt(squared); }
    return normal;
}

// Quaternions are (x, y, z, w).
fn times(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

fn turned(by: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    return v + 2.0 * cross(by.xyz, cross(by.xyz, v) + by.w * v);
}

// Writes a vertex moved by a sum of dual quaternions.
fn write_moved(at: vec2<u32>, real_sum: vec4<f32>, dual_sum: vec4<f32>, position: vec3<f32>, normal: vec3<f32>) {
    let shrink = inverseSqrt(max(dot(real_sum, real_sum), 1e-30));
    let real = real_sum * shrink;
    let dual = dual_sum * shrink;
    let shift = 2.0 * (real.w * dual.xyz - dual.w * real.xyz + cross(real.xyz, dual.xyz));
    write_posed(at, turned(real, position) + shift, turned(real, normal));
}
