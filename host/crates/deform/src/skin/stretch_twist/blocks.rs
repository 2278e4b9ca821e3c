//! What stretching and twisting adds to the blocks of the underlying method: how far along its bone each influence is,
//! and the same influences ordered by bone.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use std::collections::HashMap;
use std::ops::Range;

use armature_geometry::Influences;

use crate::lanes::{LANES, Lane};
use crate::skin::blocks::{Block, Layer, SkinBlocks};

/// A block is processed bone by bone if it has at most this many times as many bones as layers: its vertices then share
/// the numbers of each bone they follow. Eight influences of one bone take half the time of eight of different bones.
const BONES_PER_LAYER: usize = 2;

#[derive(Clone, Debug)]
pub(super) struct TwistBlocks {
    pub(super) blocks: Vec<TwistBlock>,
    /// How far towards its bone's end each influence is, in the order of the underlying method's layers.
    pub(super) ends: Vec<Lane>,
    pub(super) by_bone: Vec<OneBone>,
    /// The sets of bones that blocks follow, each once.
    sets: Vec<Vec<u16>>,
    /// Which of the sets the underlying method handles alone in this pose.
    plain: Vec<bool>,
}

/// Eight vertices.
#[derive(Clone, Debug)]
pub(super) struct TwistBlock {
    /// In the underlying method's layout.
    pub(super) block: Block,
    /// Their influences by bone, if the bones are few enough.
    by_bone: Range<u32>,
    set: u32,
    /// For each lane, the heaviest bone and where along it the vertex is.
    pub(super) pivot: Layer,
    /// Whether that is one bone for all of them, and the first of `by_bone`.
    pub(super) one_pivot: bool,
}

/// The influences of eight vertices on one bone.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct OneBone {
    pub(super) weights: Lane,
    pub(super) ends: Lane,
    pub(super) bone: u16,
}

/// How a block's vertices are posed.
pub(super) enum Way {
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

impl AsMut<Block> for TwistBlock {
    fn as_mut(&mut self) -> &mut Block {
        &mut self.block
    }
}

impl TwistBlocks {
    pub(super) fn new(blocks: &SkinBlocks, influences: &Influences, end_weights: &[f32]) -> Self {
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

    /// Records which bones neither stretch nor twist.
    pub(super) fn set_plain(&mut self, is_plain: impl Fn(u16) -> bool) {
        for (plain, bones) in self.plain.iter_mut().zip(&self.sets) {
            *plain = bones.iter().all(|bone| is_plain(*bone));
        }
    }

    #[inline(always)]
    pub(super) fn way(&self, block: &TwistBlock) -> Way {
        if self.plain[block.set as usize] {
            Way::Plain
        } else if block.by_bone.is_empty() {
            Way::Mixed
        } else {
            Way::ByBone(block.by_bone.start as usize..block.by_bone.end as usize)
        }
    }
}
