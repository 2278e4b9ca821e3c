// Twin: armature_deform::skin::StretchTwistSkin (thesis eqs. 6.4 to 6.6).

// A bone: its rotation; its axis at rest and half the twist at its start; its start at rest and how much half the twist
// grows to its end; its current start; what stretching adds to its end.
const BONE: u32 = 5u;

// The precision of the built-in functions depends on the driver.
fn sine_and_cosine(angle: f32) -> vec2<f32> {
    let halves = round(angle * 0.31830989);
    // π in two parts, the first with so few bits that its product is exact. Both results may be negated, which for half
    // an angle is the same rotation.
    let x = (angle - halves * 3.140625) - halves * 9.676536e-4;
    let s = x * x;
    let sine = -1.6666667e-1 + s * (8.333206e-3 + s * (-1.981829e-4 + s * 2.622532e-6));
    let cosine = -4.9999928e-1 + s * (4.166377e-2 + s * (-1.3854142e-3 + s * 2.3153842e-5));
    return vec2(x + x * (s * sine), 1.0 + s * cosine);
}

// A bone's rotation at an influence's place along it.
fn turn_at(bone: u32, end: f32) -> vec4<f32> {
    let half_twist = sine_and_cosine(bones[bone + 1u].w + end * bones[bone + 2u].w);
    return times(bones[bone], vec4(half_twist.x * bones[bone + 1u].xyz, half_twist.y));
}

@compute @workgroup_size(64)
fn skin_linear(@builtin(global_invocation_id) at: vec3<u32>) {
    if at.x >= sizes.vertices { return; }
    let vertex = rest[at.x];
    var position = vec3<f32>();
    var x = vec3<f32>();
    var y = vec3<f32>();
    var z = vec3<f32>();
    for (var k = 0u; k < sizes.per_vertex; k++) {
        let influence = influences[at.x * sizes.per_vertex + k];
        let bone = BONE * (at.y * sizes.bones + influence.bone);
        let turn = turn_at(bone, influence.end);
        let arm = turned(turn, vertex.position - bones[bone + 2u].xyz);
        position += influence.weight * (bones[bone + 3u].xyz + influence.end * bones[bone + 4u].xyz + arm);
        x += influence.weight * turned(turn, vec3(1.0, 0.0, 0.0));
        y += influence.weight * turned(turn, vec3(0.0, 1.0, 0.0));
        z += influence.weight * turned(turn, vec3(0.0, 0.0, 1.0));
    }
    let rows = transpose(mat3x3(x, y, z));
    write_posed(at.xy, position, turned_by_map(rows[0], rows[1], rows[2], vertex.normal));
}

@compute @workgroup_size(64)
fn skin_dual(@builtin(global_invocation_id) at: vec3<u32>) {
    if at.x >= sizes.vertices { return; }
    let vertex = rest[at.x];
    let first = at.x * sizes.per_vertex;
    var pivot = vec4<f32>();
    var real = vec4<f32>();
    var dual = vec4<f32>();
    for (var k = 0u; k < sizes.per_vertex; k++) {
        let influence = influences[first + k];
        let bone = BONE * (at.y * sizes.bones + influence.bone);
        let turn = turn_at(bone, influence.end);
        if k == 0u { pivot = turn; }
        let weight = select(influence.weight, -influence.weight, dot(pivot, turn) < 0.0);
        let longer = influence.end * bones[bone + 4u].xyz;
        let shift = bones[bone + 3u].xyz + longer - turned(turn, bones[bone + 2u].xyz);
        real += weight * turn;
        dual += 0.5 * weight * times(vec4(shift, 0.0), turn);
    }
    write_moved(at.xy, real, dual, vertex.position, vertex.normal);
}
