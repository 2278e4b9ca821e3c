//! The character's shape as the energy sees it, reduced to the handles of a layout.

use std::ops::ControlFlow;
use std::sync::Arc;

use armature_deform::arap::{ArapEnergy, ArapShape, ArapWeights, ReducedArap, SharedJoint, WeightRows};
use armature_geometry::TriangleMesh;
use armature_rig::TargetError;
use glam::{DVec3, Vec3};

use super::error::IkError;
use super::inside::Inside;
use super::layout::Layout;
use super::rest::RestRig;
use super::settings::{IkEnergy, IkSettings};
use crate::character::{Character, Surface};

/// The character's shape as the energy sees it.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    surface: Arc<Surface>,
    /// Its vertices in the skeleton's rest pose, where some part was bound in another.
    in_rest_pose: Option<Vec<[f64; 3]>>,
    /// What fills it, once that has been asked for.
    inside: Option<Arc<Inside>>,
}

impl Shape {
    pub(super) fn of(character: &Character) -> Result<Self, IkError> {
        let surface = character.surface.clone();
        let in_rest_pose = if surface.parts.iter().any(|part| part.skin.is_some()) {
            Some(character.positions_in_rest_pose()?.iter().map(|p| p.map(f64::from)).collect())
        } else {
            None
        };
        Ok(Self { surface, in_rest_pose, inside: None })
    }

    /// For every bone, the total weight of all vertices.
    pub(super) fn weight_of_bones(&self, bones: usize) -> Vec<f64> {
        let mut weight = vec![0.0; bones];
        for vertex in 0..self.surface.influences.vertex_count() {
            self.surface.influences.of_vertex(vertex).for_each(|(bone, w)| weight[usize::from(bone)] += f64::from(w));
        }
        weight
    }

    /// The bones that move a point of the skin: each with its share, and where the point is at rest as that bone moves it.
    pub(super) fn bones_of_point(
        &self,
        vertices: [u32; 3],
        barycentric: [f32; 3],
    ) -> Result<Vec<(usize, f64, Vec3)>, TargetError> {
        let positions = self.in_rest_pose.as_ref().unwrap_or(&self.surface.mesh.vertices);
        if vertices.iter().any(|&vertex| vertex as usize >= positions.len()) {
            return Err(TargetError::NoSuchPoint { vertices: positions.len() });
        }
        let mut sums: std::collections::BTreeMap<usize, (f64, DVec3)> = std::collections::BTreeMap::new();
        for (vertex, share) in vertices.into_iter().map(|vertex| vertex as usize).zip(barycentric) {
            for (bone, weight) in self.surface.influences.of_vertex(vertex) {
                let weight = f64::from(weight) * f64::from(share);
                let sum = sums.entry(usize::from(bone)).or_default();
                *sum = (sum.0 + weight, sum.1 + weight * DVec3::from(positions[vertex]));
            }
        }
        sums.retain(|_, (weight, _)| weight.abs() > 1e-6);
        let whole: f64 = sums.values().map(|(weight, _)| weight).sum();
        if whole.is_nan() || whole <= 1e-6 {
            return Err(TargetError::NothingMovesIt);
        }
        let bone = |(bone, (weight, sum)): (usize, (f64, DVec3))| (bone, weight / whole, (sum / weight).as_vec3());
        Ok(sums.into_iter().map(bone).collect())
    }

    /// Finds what fills the surface, where the energy needs it.
    pub(super) fn fill(
        &mut self,
        bones: usize,
        energy: IkEnergy,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<(), IkError> {
        if energy == IkEnergy::Volume && self.inside.is_none() {
            let Surface { mesh, influences, .. } = &*self.surface;
            let vertices = self.in_rest_pose.as_ref().unwrap_or(&mesh.vertices).clone();
            let surface = TriangleMesh { vertices, triangles: mesh.triangles.clone() };
            self.inside = Some(Arc::new(Inside::of(&surface, influences, bones, progress)?));
        }
        Ok(())
    }

    pub(super) fn reduce(
        &self,
        rig: &RestRig,
        layout: &Layout,
        settings: &IkSettings,
        progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    ) -> Result<ReducedArap, IkError> {
        let inside = self.inside.as_deref().filter(|_| settings.energy == IkEnergy::Volume);
        let mut weights = WeightRows::default();
        if let Some(inside) = inside {
            for vertex in 0..inside.positions.len() {
                let followed = inside.weights.of(vertex).iter();
                weights.push(followed.map(|(bone, weight)| (layout.handle_of_bone[*bone as usize], *weight)));
            }
        } else {
            for vertex in 0..self.surface.mesh.vertices.len() {
                let of_handle = |(bone, weight)| (layout.handle_of_bone[usize::from(bone)], f64::from(weight));
                weights.push(self.surface.influences.of_vertex(vertex).map(of_handle));
            }
        }
        let head = |bone: usize| rig.heads[bone].as_dvec3().to_array();
        let handle_points: Vec<[f64; 3]> = layout.bone_of_handle.iter().map(|&bone| head(bone)).collect();
        let joint = |(handle, &bone): (usize, &usize)| {
            let above = layout.handle_of_bone[rig.parent(bone)?];
            let redundant = layout.placed[above] && layout.placed[handle];
            (!redundant).then(|| SharedJoint { handles: [above, handle], point: head(bone) })
        };
        let joints: Vec<SharedJoint> = layout.bone_of_handle.iter().enumerate().filter_map(joint).collect();
        let mut arap = ReducedArap::precompute(
            &ArapShape {
                positions: match inside {
                    Some(inside) => &inside.positions,
                    None => self.in_rest_pose.as_ref().unwrap_or(&self.surface.mesh.vertices),
                },
                energy: match inside {
                    Some(inside) => ArapEnergy::Tetrahedra(&inside.tetrahedra),
                    None => ArapEnergy::SpokesAndRims(&self.surface.mesh.triangles),
                },
                weights: ArapWeights::Rows(&weights),
                handle_points: &handle_points,
                joints: &joints,
            },
            &settings.reduction(layout.handle_count()),
            progress,
        )?;
        arap.constrain(&layout.constraints, &[])?;
        Ok(arap)
    }
}
