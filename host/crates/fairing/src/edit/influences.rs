//! Displacements are linear in those of the handles: what each handle does alone, solved for beforehand.

use std::collections::BTreeMap;

use crate::mixed::{Fairing, FairingError, Solution, Values};

/// Handles solved for together.
const TOGETHER: usize = 8;

/// How far every vertex follows each handle.
#[derive(Debug)]
pub(super) struct Influences {
    /// Local vertices of the handles, ascending.
    columns: Vec<u32>,
    /// A row for each local vertex.
    values: Vec<f64>,
    /// What vertices do while no handle moves, because of given slopes.
    still: Vec<[f64; 3]>,
    /// The largest of the linear systems.
    residual: f64,
}

impl Influences {
    /// `fixed`, `sharp` and `tangents` are the conditions of `fairing`: vertices with a given value, how many Laplacians of
    /// zero, and given derivatives. There must be a column.
    pub(super) fn solve(
        fairing: &Fairing,
        fixed: &[u32],
        sharp: usize,
        tangents: &[[[f64; 3]; 2]],
        columns: Vec<u32>,
    ) -> Result<Self, FairingError> {
        let width = columns.len();
        let (held, level) = (vec![[0.0; 3]; fixed.len()], vec![[0.0; 3]; sharp]);
        let still = fairing.solve(&Values { fixed: &held, tangents, laplacians: &level, source: &[] })?;
        let values = vec![0.0; width * fairing.vertex_count()];
        let mut influences = Self { columns, values, still: still.values, residual: still.residual };
        let flat = vec![[[0.0; TOGETHER]; 2]; tangents.len()];
        let laplacians = vec![[0.0; TOGETHER]; sharp];
        for (group, handles) in influences.columns.chunks(TOGETHER).enumerate() {
            let one = |v: &u32| std::array::from_fn(|k| if handles.get(k) == Some(v) { 1.0 } else { 0.0 });
            let alone: Vec<[f64; TOGETHER]> = fixed.iter().map(one).collect();
            let given = Values { fixed: &alone, tangents: &flat, laplacians: &laplacians, source: &[] };
            let Solution { values, residual } = fairing.solve(&given)?;
            influences.residual = influences.residual.max(residual);
            for (row, value) in influences.values.chunks_exact_mut(width).zip(&values) {
                let place = group * TOGETHER;
                row[place..place + handles.len()].copy_from_slice(&value[..handles.len()]);
            }
        }
        Ok(influences)
    }

    /// What all handles do together. `dragged` holds each by its local vertex.
    pub(super) fn sum(&self, dragged: &BTreeMap<u32, [f64; 3]>) -> Solution<3> {
        let width = self.columns.len();
        let by: Vec<[f64; 3]> = self.columns.iter().map(|v| dragged.get(v).copied().unwrap_or_default()).collect();
        let sum = |(row, still): (&[f64], &[f64; 3])| {
            row.iter().zip(&by).fold(*still, |sum, (w, by)| std::array::from_fn(|k| sum[k] + w * by[k]))
        };
        let rows = self.values.chunks_exact(width).zip(&self.still);
        Solution { values: rows.map(sum).collect(), residual: self.residual }
    }
}
