//! Where a character's skin stands out furthest, bone by bone.

use std::f32::consts::FRAC_PI_4;

use glam::{Affine3A, Vec3};

use crate::character::Character;

/// For every bone, the vertices that follow it more than any other bone and lie furthest in each of 26 directions: up,
/// down, and eight all around, level and at 45° to either side of that. As the bone and the place in its frame, mesh
/// units; without repetitions, ordered by bone. What must not cross a floor is above it if these are, as far as vertices
/// follow one bone.
pub fn outermost_points(character: &Character) -> Vec<(usize, Vec3)> {
    let directions = directions();
    let bones = character.skeleton.len();
    let rest = character.skeleton.rest_model_from_bone();
    let mut furthest: Vec<Option<(f32, u32)>> = vec![None; bones * directions.len()];
    let surface = &character.surface;
    let positions = character.rest_positions();
    for (vertex, position) in positions.iter().enumerate() {
        let Some((bone, _)) = surface.influences.of_vertex(vertex).next() else { continue };
        let slots = &mut furthest[usize::from(bone) * directions.len()..][..directions.len()];
        for (slot, direction) in slots.iter_mut().zip(&directions) {
            let along = direction.dot(Vec3::from(*position));
            if slot.is_none_or(|(most, _)| along > most) {
                *slot = Some((along, vertex as u32));
            }
        }
    }
    let mut points = Vec::new();
    for (bone, slots) in furthest.chunks_exact(directions.len()).enumerate() {
        let mut vertices: Vec<u32> = slots.iter().flatten().map(|(_, vertex)| *vertex).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for vertex in vertices {
            let bound = frame_of(character, &rest, vertex, bone);
            let at = bound.inverse().transform_point3(positions[vertex as usize].into());
            // A bone of no size at binding has no frame.
            points.extend(at.is_finite().then_some((bone, at)));
        }
    }
    points
}

/// `model_from_bone` of the pose in which the vertex's part was bound.
fn frame_of(character: &Character, rest: &[Affine3A], vertex: u32, bone: usize) -> Affine3A {
    let part = character.surface.parts.iter().find(|part| part.vertices.contains(&vertex));
    let skin = part.and_then(|part| character.skins.get(part.skin? as usize));
    skin.and_then(|skin| skin.bound_model_from_bone.get(bone)).copied().unwrap_or(rest[bone])
}

fn directions() -> Vec<Vec3> {
    let around = (0..8).flat_map(|step| {
        let (sin, cos) = libm::sincosf(step as f32 * FRAC_PI_4);
        [-1.0, 0.0, 1.0].map(|up| Vec3::new(sin, up, cos))
    });
    around.chain([Vec3::Y, Vec3::NEG_Y]).collect()
}
