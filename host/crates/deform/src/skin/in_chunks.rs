//! Vertices in parts: one after the other if there are few, in parallel on rayon's threads if there are many.

use rayon::prelude::*;

/// Vertices that a thread takes at a time.
const CHUNK: usize = 4096;
/// Below this many vertices, waking a second thread costs more than it saves: linear blending takes about 0.27 ms for
/// 32k vertices on one core, a wake-up 0.02 to 0.1 ms.
pub(super) const PARALLEL_FROM: usize = 8 * CHUNK;

/// Calls `skin` on blocks of `N` vertices with the outputs for their positions and normals, n×3 each; the last block
/// may have fewer.
pub(super) fn in_chunks<const N: usize, B: Sync>(
    blocks: &[B],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
    skin: impl Fn(&[B], &mut [[f32; 3]], &mut [[f32; 3]]) + Sync,
) {
    if positions.len() < PARALLEL_FROM {
        skin(blocks, positions, normals);
        return;
    }
    blocks
        .par_chunks(CHUNK / N)
        .zip(positions.par_chunks_mut(CHUNK))
        .zip(normals.par_chunks_mut(CHUNK))
        .for_each(|((blocks, positions), normals)| skin(blocks, positions, normals));
}
