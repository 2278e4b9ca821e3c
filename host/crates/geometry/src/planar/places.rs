//! Where vertices must be: those of the input, samples along bones, point handles.

use super::input::{PlanarInput, PlanarShape};
use super::outline::Outline;
use super::samples::samples;
use crate::surface::weld_vertices;

/// Handles outside this range (the outline is between 1.5 and 3.5) need no vertex: nothing is inside there.
const NEAR: std::ops::RangeInclusive<f64> = 1.25..=3.75;
/// A handle closer than this to a vertex of the outline or to another handle shares its vertex.
const SAME: f64 = 1e-6;

/// Distinct places, in the outline's frame and in the input's coordinates, and what is at each.
#[derive(Clone, Debug)]
pub(super) struct Places {
    pub(super) unit: Vec<[f64; 2]>,
    pub(super) input: Vec<[f64; 2]>,
    pub(super) of_vertex: Vec<u32>,
    pub(super) of_bone: Vec<Vec<u32>>,
    /// `None` for a point far out.
    pub(super) of_point: Vec<Option<u32>>,
    /// Samples far out, which have no place.
    pub(super) samples_far_out: usize,
}

impl Places {
    pub(super) fn new(input: &PlanarInput, outline: &Outline, largest: f64) -> Self {
        let corners = match input.shape {
            PlanarShape::Outline { vertices, .. } | PlanarShape::Mesh { vertices, .. } => vertices,
        };
        let mut all = All { unit: outline.vertices.clone(), input: corners.to_vec() };
        let mut samples_far_out = 0;
        let mut bones: Vec<Vec<usize>> = Vec::new();
        for bone in input.bones {
            let ends = bone.map(|p| outline.frame.unit_from_input(p));
            let along = samples(ends, &outline.vertices, &outline.segments, largest);
            let (first, last) = (0, along.len() - 1);
            let mut indices = Vec::new();
            for (k, &p) in along.iter().enumerate() {
                let exactly = if k == first {
                    bone[0]
                } else if k == last {
                    bone[1]
                } else {
                    outline.frame.input_from_unit(p)
                };
                match all.add(p, exactly) {
                    Some(index) => indices.push(index),
                    None => samples_far_out += 1,
                }
            }
            bones.push(indices);
        }
        let points: Vec<Option<usize>> =
            input.points.iter().map(|&p| all.add(outline.frame.unit_from_input(p), p)).collect();
        let weld = weld_vertices(&all.unit.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<_>>(), 0.0);
        let of = |index: usize| weld.welded_of[index];
        let along = |indices: &Vec<usize>| {
            let mut vertices: Vec<u32> = indices.iter().map(|&index| of(index)).collect();
            vertices.dedup();
            vertices
        };
        Self {
            unit: weld.representative.iter().map(|&v| all.unit[v as usize]).collect(),
            input: weld.representative.iter().map(|&v| all.input[v as usize]).collect(),
            of_vertex: (0..corners.len()).map(of).collect(),
            of_bone: bones.iter().map(along).collect(),
            of_point: points.iter().map(|p| p.map(of)).collect(),
            samples_far_out,
        }
    }
}

/// Positions with repetitions.
struct All {
    unit: Vec<[f64; 2]>,
    input: Vec<[f64; 2]>,
}

impl All {
    /// The index of a handle, a new one unless something is already there; `None` if it is far out.
    fn add(&mut self, p: [f64; 2], exactly: [f64; 2]) -> Option<usize> {
        if !p.iter().all(|c| NEAR.contains(c)) {
            return None;
        }
        let distance = |q: &[f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
        let vertices = self.unit.iter().enumerate();
        let nearest = vertices.map(|(index, q)| (distance(q), index)).min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, index)) = nearest
            && distance < SAME
        {
            return Some(index);
        }
        self.unit.push(p);
        self.input.push(exactly);
        Some(self.unit.len() - 1)
    }
}
