//! Which pinned bones were not where they are pinned, and by how much.

use armature_character::inverse_kinematics::{InverseKinematics, PinHold};
use glam::{Affine3A, Vec3A};

use crate::characters::LoadedCharacter;
use crate::characters::ground::places_roots;

/// A pinned bone.
#[derive(Clone, Debug)]
struct Pin {
    bone: usize,
    name: String,
    place: Vec3A,
    /// One for each coordinate that is held.
    held: Vec3A,
    furthest: f32,
}

/// Pinned bones, and how far each was from its place at most.
#[derive(Clone, Debug, Default)]
pub(super) struct MissedPins {
    pins: Vec<Pin>,
}

impl MissedPins {
    /// Of what is pinned besides roots, which are where they are put.
    pub(super) fn of(ik: Option<&InverseKinematics>, character: &LoadedCharacter) -> Self {
        let Some(ik) = ik.filter(|ik| places_roots(ik, character)) else { return Self::default() };
        let rest = character.skeleton.rest_model_from_bone();
        let pins = ik.pins().filter_map(|pin| {
            let bone = character.skeleton.find(&pin.bone)?;
            let held = if pin.hold == PinHold::Upright { Vec3A::new(1.0, 0.0, 1.0) } else { Vec3A::ONE };
            Some(Pin { bone, name: pin.bone, place: rest[bone].translation, held, furthest: 0.0 })
        });
        Self { pins: pins.collect() }
    }

    /// Begins anew.
    pub(super) fn forget(&mut self) {
        self.pins.iter_mut().for_each(|pin| pin.furthest = 0.0);
    }

    /// Looks at a pose.
    pub(super) fn see(&mut self, model_from_bone: &[Affine3A]) {
        for pin in &mut self.pins {
            let away = ((model_from_bone[pin.bone].translation - pin.place) * pin.held).length();
            pin.furthest = pin.furthest.max(away);
        }
    }

    /// Those that were further away than this, mesh units, and how far.
    pub(super) fn beyond(&self, distance: f32) -> Vec<(String, f32)> {
        let missed = self.pins.iter().filter(|pin| pin.furthest > distance);
        missed.map(|pin| (pin.name.clone(), pin.furthest)).collect()
    }
}
