//! The name of a cached character: a fingerprint of everything that went into it.

use std::fmt;

use armature_weights::heat::Visibility;

use super::format::BINDING_VERSION;
use crate::bind::{BindMethod, BindSettings, TwistCurve};
use crate::handle_weights::{BiharmonicTier, WeightsOn};
use crate::skin_kind::SkinKind;

/// Monotone weights of each order have a number of their own, after those of all other methods.
const FIRST_MONOTONE: u8 = 0x10;

/// A BLAKE3 hash; printed as 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CacheKey([u8; 32]);

impl CacheKey {
    /// The hash itself.
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for CacheKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// The key of the character made from `files` (every input file: the mesh, its materials and textures, the skeleton;
/// always in the same order) and `settings`. Versions that bind differently give different keys.
pub fn cache_key(files: &[&[u8]], settings: &BindSettings) -> CacheKey {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armature character");
    hasher.update(&BINDING_VERSION.to_le_bytes());
    hasher.update(&(files.len() as u64).to_le_bytes());
    for file in files {
        hasher.update(&(file.len() as u64).to_le_bytes());
        hasher.update(file);
    }
    // Destructured, so that a new setting cannot be forgotten here.
    let BindSettings {
        replace_rig,
        max_influences,
        limit_painted,
        bind_unbound,
        transfer,
        method,
        on,
        joint_release,
        smooth_weights,
        heat,
        skin,
        endpoints,
        twist_curves,
    } = settings;
    let armature_weights::heat::BoneHeatSettings { heat, tie_ratio, weld_ratio, visibility } = heat;
    let visibility = match visibility {
        Visibility::Inside => 0,
        Visibility::Ignored => 1,
    };
    let method = match method {
        BindMethod::BoneHeat => 0,
        BindMethod::Biharmonic(BiharmonicTier::Interactive) => 1,
        BindMethod::Biharmonic(BiharmonicTier::Certified) => 2,
        BindMethod::Monotone { order } => FIRST_MONOTONE.saturating_add(*order),
    };
    let (on, vertices) = match on {
        WeightsOn::Volume { vertices } => (0, *vertices),
        WeightsOn::OwnElements => (1, 0),
        WeightsOn::Surface => (2, 0),
    };
    hasher.update(&[u8::from(*replace_rig), visibility, method, on]);
    hasher.update(&(vertices as u64).to_le_bytes());
    hasher.update(&(*max_influences as u64).to_le_bytes());
    for number in [heat, tie_ratio, weld_ratio, joint_release] {
        hasher.update(&number.to_le_bytes());
    }
    // Characters bound without these keep their key.
    if let Some(most) = limit_painted {
        hasher.update(b"limited");
        hasher.update(&(*most as u64).to_le_bytes());
    }
    if *bind_unbound {
        hasher.update(b"what came without weights bound");
    }
    for part in transfer {
        hasher.update(b"transferred");
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    if let Some(least) = smooth_weights {
        hasher.update(b"smoothed");
        hasher.update(&least.to_le_bytes());
    }
    if *skin != SkinKind::Linear {
        hasher.update(b"skin");
        hasher.update(skin.name().as_bytes());
    }
    if let Some(method) = endpoints {
        hasher.update(b"endpoints");
        hasher.update(method.name().as_bytes());
    }
    for TwistCurve { bone, curve } in twist_curves {
        hasher.update(b"twist curve");
        hasher.update(&(bone.len() as u64).to_le_bytes());
        hasher.update(bone.as_bytes());
        for number in curve.points().as_flattened() {
            hasher.update(&number.to_le_bytes());
        }
    }
    CacheKey(*hasher.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use armature_weights::endpoints::SplineFilter;

    use super::*;
    use crate::skin_kind::EndpointMethod;

    #[test]
    fn every_input_changes_the_key() {
        let plain = BindSettings::default();
        let mut other = BindSettings::default();
        other.heat.heat = 0.22;
        let keys = [
            cache_key(&[b"mesh", b"bones"], &plain),
            cache_key(&[b"meshb", b"ones"], &plain),
            cache_key(&[b"meshbones"], &plain),
            cache_key(&[b"mesh", b"bones", b""], &plain),
            cache_key(&[b"mesh", b"bones"], &other),
            cache_key(&[b"mesh", b"bones"], &BindSettings { max_influences: 3, ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { replace_rig: true, ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { limit_painted: Some(4), ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { bind_unbound: true, ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { transfer: vec!["coat".into()], ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { method: BindMethod::BoneHeat, ..plain.clone() }),
            cache_key(
                &[b"mesh", b"bones"],
                &BindSettings { method: BindMethod::Monotone { order: 2 }, ..plain.clone() },
            ),
            cache_key(
                &[b"mesh", b"bones"],
                &BindSettings { method: BindMethod::Monotone { order: 3 }, ..plain.clone() },
            ),
            cache_key(&[b"mesh", b"bones"], &BindSettings { on: WeightsOn::Surface, ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { smooth_weights: Some(0.1), ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { joint_release: 0.0, ..plain.clone() }),
            cache_key(&[b"mesh", b"bones"], &BindSettings { skin: SkinKind::DualQuaternion, ..plain.clone() }),
            cache_key(
                &[b"mesh", b"bones"],
                &BindSettings { endpoints: Some(EndpointMethod::Projection), ..plain.clone() },
            ),
            cache_key(
                &[b"mesh", b"bones"],
                &BindSettings {
                    twist_curves: vec![TwistCurve { bone: "spine".into(), curve: SplineFilter::through(&[]).unwrap() }],
                    ..plain.clone()
                },
            ),
            cache_key(&[b"mesh", b"bones"], &BindSettings { on: WeightsOn::Volume { vertices: 500 }, ..plain.clone() }),
        ];
        let distinct: std::collections::BTreeSet<_> = keys.iter().map(ToString::to_string).collect();
        assert_eq!(distinct.len(), keys.len());
        assert_eq!(keys[0], cache_key(&[b"mesh", b"bones"], &plain));
        assert_eq!(keys[0].to_string().len(), 64);
    }
}
