//! The vertices of a mesh whose normals, texture coordinates and colours belong to corners, as FBX and USD have it.

use std::collections::HashMap;

use glam::DVec3;

use super::pieces::{Cut, Piece};

/// The vertices of a mesh in a file: those of the welded mesh, so that a surface stays closed. Where a morph target moves
/// two drawn vertices of one place apart (the lips of a closed mouth), they are two.
pub(crate) struct Points {
    /// The mesh vertex of each.
    pub(crate) vertex: Vec<u32>,
    /// Position without morph targets.
    pub(crate) position: Vec<[f64; 3]>,
    /// By piece: the vertex of each drawn vertex.
    pub(crate) of_drawn: Vec<Vec<u32>>,
}

impl Points {
    /// Those of pieces that are one mesh.
    pub(crate) fn of(cut: &Cut, group: &[Piece]) -> Self {
        let mut known: HashMap<(u32, Vec<[u32; 3]>), u32> = HashMap::new();
        let mut points = Self { vertex: Vec::new(), position: Vec::new(), of_drawn: Vec::new() };
        for piece in group {
            let drawn = cut.vertex_of[piece.drawn()].iter().enumerate().map(|(k, &vertex)| {
                let offsets = piece.targets.iter().map(|target| target.positions[k].map(f32::to_bits)).collect();
                *known.entry((vertex, offsets)).or_insert_with(|| {
                    points.vertex.push(vertex);
                    points.position.push(piece.base_position(cut.surface.mesh.vertices[vertex as usize], k));
                    points.vertex.len() as u32 - 1
                })
            });
            let drawn = drawn.collect();
            points.of_drawn.push(drawn);
        }
        points
    }

    /// What weight 1 of morph target `target` of the pieces adds to each vertex, and to its normal (the mean over its
    /// drawn vertices; zero where the file gives none).
    pub(crate) fn moved_by(&self, group: &[Piece], target: usize) -> Vec<([f32; 3], DVec3)> {
        let mut moved: Vec<([f32; 3], DVec3, f64)> = vec![([0.0; 3], DVec3::ZERO, 0.0); self.vertex.len()];
        for (piece, of_drawn) in group.iter().zip(&self.of_drawn) {
            let target = piece.targets[target];
            for (drawn, &point) in of_drawn.iter().enumerate() {
                let slot = &mut moved[point as usize];
                slot.0 = target.positions[drawn];
                if let Some(normal) = target.normals.get(drawn) {
                    slot.1 += DVec3::from(normal.map(f64::from));
                    slot.2 += 1.0;
                }
            }
        }
        moved.into_iter().map(|(offset, sum, count)| (offset, sum / count.max(1.0))).collect()
    }
}
