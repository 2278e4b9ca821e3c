// Twin: armature_deform::skin::DualQuaternionSkin. A bone is the real and the dual part of its motion since rest.

@compute @workgroup_size(64)
fn skin(@builtin(global_invocation_id) at: vec3<u32>) {
    if at.x >= sizes.vertices { return; }
    let first = at.x * sizes.per_vertex;
    let pivot = bones[2u * (at.y * sizes.bones + influences[first].bone)];
    var real = vec4<f32>();
    var dual = vec4<f32>();
    for (var k = 0u; k < sizes.per_vertex; k++) {
        let influence = influences[first + k];
        let bone = 2u * (at.y * sizes.bones + influence.bone);
        let weight = select(influence.weight, -influence.weight, dot(pivot, bones[bone]) < 0.0);
        real += weight * bones[bone];
        dual += weight * bones[bone + 1u];
    }
    let vertex = rest[at.x];
    write_moved(at.xy, real, dual, vertex.position, vertex.normal);
}
