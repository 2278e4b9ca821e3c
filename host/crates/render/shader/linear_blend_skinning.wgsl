// Twin: armature_deform::skin::LinearBlendSkin. A bone is the three rows of its `model_from_rest`.

@compute @workgroup_size(64)
fn skin(@builtin(global_invocation_id) at: vec3<u32>) {
    if at.x >= sizes.vertices { return; }
    var x = vec4<f32>();
    var y = vec4<f32>();
    var z = vec4<f32>();
    for (var k = 0u; k < sizes.per_vertex; k++) {
        let influence = influences[at.x * sizes.per_vertex + k];
        let bone = 3u * (at.y * sizes.bones + influence.bone);
        x += influence.weight * bones[bone];
        y += influence.weight * bones[bone + 1u];
        z += influence.weight * bones[bone + 2u];
    }
    let vertex = rest[at.x];
    let homogeneous = vec4(vertex.position, 1.0);
    let position = vec3(dot(x, homogeneous), dot(y, homogeneous), dot(z, homogeneous));
    write_posed(at.xy, position, turned_by_map(x.xyz, y.xyz, z.xyz, vertex.normal));
}
