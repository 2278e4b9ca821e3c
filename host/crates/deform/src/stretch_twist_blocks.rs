//! What stretching and twisting reads beside the blocks of the underlying method: how far along its bone each
//! influence sits, and the same influences ordered by bones.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use std::collections::HashMap;
use std::ops::Range;

use armature_geometry::Influences;

use crate::nearest_rotation::{LANES, Lane};
use crate::skin_blocks::{Block, Layer, SkinBlocks};

/// A block goes by bones where these are at most this many times its layers: then its vertices, as far as they follow
/// the same bone, share its numbers. Eight influences of one bone take half the time of eight of different ones.
const BONES_PER_LAYER: usize = 2;

#[derive(Clone, Debug)]
pub(crate) struct TwistBlocks {
    pub(crate) blocks: Vec<TwistBlock>,
    /// How far towards its bone's end each influence sits, in the order of the underlying method's layers.
    pub(crate) ends: Vec<Lane>,
    pub(crate) by_bone: Vec<OneBone>,
    /// The sets of bones that blocks follow, each once.
    sets: Vec<Vec<u16>>,
    /// Which of the sets are as the underlying method has them in this pose.
    plain: Vec<bool>,
}

/// Eight vertices.
#[derive(Clone, Debug)]
pub(crate) struct TwistBlock {
    /// As the underlying method reads them.
    pub(crate) block: Block,
    /// Their influences by bones, if they are few enough.
    by_bone: Range<u32>,
    set: u32,
    /// Of each lane the heaviest bone and where on it the vertex sits.
    pub(crate) pivot: Layer,
    /// Whether that is one bone for all of them, and the first of `by_bone`.
    pub(crate) one_pivot: bool,
}

/// What eight vertices have of one bone.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct OneBone {
    pub(crate) weights: Lane,
    pub(crate) ends: Lane,
    pub(crate) bone: u16,
}

/// How a block's vertices are posed.
pub(crate) enum Way {
    /// None of their bones stretches or twists: by the underlying method itself.
    Plain,
    /// Bone by bone.
    ByBone(Range<usize>),
    /// Influence by influence.
    Mixed,
}

impl AsRef<Block> for TwistBlock {
    #[inline(always)]
    fn as_ref(&self) -> &Block {
        &self.block
    }
}

impl TwistBlocks {
    pub(crate) fn new(blocks: &SkinBlocks, influences: &Influences, end_weights: &[f32]) -> Self {
        let clamped: Vec<f32> = end_weights.iter().map(|e| e.clamp(0.0, 1.0)).collect();
        let ends = blocks.by_layer(influences, &clamped);
        let mut number_of = HashMap::new();
        let mut out = Self { blocks: Vec::new(), ends, by_bone: Vec::new(), sets: Vec::new(), plain: Vec::new() };
        for block in &blocks.blocks {
            let range = block.layers();
            let (layers, ends) = (&blocks.layers[range.clone()], &out.ends[range.clone()]);
            let mut of_bones: Vec<OneBone> = Vec::new();
            for (layer, ends) in layers.iter().zip(ends) {
                for lane in (0..LANES).filter(|&lane| layer.weights[lane] != 0.0) {
                    let bone = layer.bones[lane];
                    let free =
                        |of: &OneBone| of.weights[lane] == 0.0 || of.ends[lane].to_bits() == ends[lane].to_bits();
                    let place = of_bones.iter().position(|of| of.bone == bone && free(of)).unwrap_or_else(|| {
                        of_bones.push(OneBone { weights: [0.0; LANES], ends: [0.0; LANES], bone });
                        of_bones.len() - 1
                    });
                    of_bones[place].weights[lane] += layer.weights[lane];
                    of_bones[place].ends[lane] = ends[lane];
                }
            }
            let mut bones: Vec<u16> = of_bones.iter().map(|of| of.bone).collect();
            bones.sort_unstable();
            let set = *number_of.entry(bones).or_insert_with_key(|bones| {
                out.sets.push(bones.clone());
                out.sets.len() as u32 - 1
            });
            let first = of_bones.first().map(|of| of.bone);
            let leads = |layer: &Layer| (0..LANES).all(|l| layer.weights[l] == 0.0 || Some(layer.bones[l]) == first);
            let one_pivot = layers.first().is_some_and(leads);
            let pivot = layers.first().map_or([0; LANES], |layer| layer.bones);
            let pivot = Layer { bones: pivot, weights: ends.first().copied().unwrap_or([0.0; LANES]) };
            if of_bones.len() > BONES_PER_LAYER * layers.len() {
                of_bones.clear();
            }
            let first = out.by_bone.len() as u32;
            out.by_bone.append(&mut of_bones);
            let by_bone = first..out.by_bone.len() as u32;
            out.blocks.push(TwistBlock { block: block.clone(), by_bone, set, pivot, one_pivot });
        }
        out.plain = vec![false; out.sets.len()];
        out
    }

    /// Takes which bones neither stretch nor twist.
    pub(crate) fn set_plain(&mut self, is_plain: impl Fn(u16) -> bool) {
        for (plain, bones) in self.plain.iter_mut().zip(&self.sets) {
            *plain = bones.iter().all(|bone| is_plain(*bone));
        }
    }

    #[inline(always)]
    pub(crate) fn way(&self, block: &TwistBlock) -> Way {
        if self.plain[block.set as usize] {
            Way::Plain
        } else if block.by_bone.is_empty() {
            Way::Mixed
        } else {
            Way::ByBone(block.by_bone.start as usize..block.by_bone.end as usize)
        }
    }
}
