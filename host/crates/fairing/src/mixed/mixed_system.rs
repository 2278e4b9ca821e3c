//! The systems that keep the Laplacian as an unknown: (3.11), (3.13), (3.16) and (3.18) of the thesis.
//!
//! ```text
//! Laplacian:            gradient of the Laplacian:
//! ⎡-M  L⎤ ⎡v⎤           ⎡ L  0 -M⎤ ⎡v⎤
//! ⎣ L  0⎦ ⎣u⎦           ⎢ 0  0  L⎥ ⎢u⎥
//!                       ⎣-M  L  C⎦ ⎣λ⎦
//! ```
//!
//! C is zero but for the stabilised multipliers of bent vertices.

use armature_geometry::operators::SparseMatrix;

use super::conditions::Role;
use super::error::FairingError;
use super::problem::{Energy, Known, Mass, Parts};
use crate::sparse::{FactorError, Lu};

/// A residual above this after refinement means that the matrix is singular to working precision.
const SOLVED: f64 = 1e-6;
const STEPS: usize = 3;
const NONE: u32 = u32::MAX;

#[derive(Debug)]
pub(super) struct MixedSystem {
    energy: Energy,
    mass: SparseMatrix,
    matrix: SparseMatrix,
    lu: Lu,
    layout: Layout,
}

/// Which unknown stands where.
#[derive(Debug)]
struct Layout {
    /// Vertices where v is unknown.
    v: Vec<u32>,
    /// Vertices where u is unknown.
    u: Vec<u32>,
    /// Vertices where λ is unknown; empty for the Laplacian energy.
    lambda: Vec<u32>,
    v_at: Vec<u32>,
    u_at: Vec<u32>,
    lambda_at: Vec<u32>,
    bent: Vec<bool>,
    /// Whether the mass matrix is diagonal, so that v is known where u is.
    lumped: bool,
}

impl MixedSystem {
    pub(super) fn factorise(parts: &Parts<'_>, mass: Mass, retained: bool) -> Result<Self, FairingError> {
        let count = parts.roles.len();
        let (matrix_of_mass, lumped) = match mass {
            Mass::Full => (parts.elements.full_mass(), false),
            Mass::Lumped(lumping) => (diagonal(&parts.elements.lumped(lumping)), true),
        };
        let mut near = vec![!lumped; count];
        for &vertex in parts.free {
            parts.laplacian.column(vertex as usize).for_each(|(row, _)| near[row] = true);
        }
        let mut used = vec![false; count];
        parts.elements.triangles().iter().flatten().for_each(|&v| used[v as usize] = true);
        let all = 0..count as u32;
        let v: Vec<u32> =
            all.clone().filter(|&i| near[i as usize] && used[i as usize] && !parts.bent[i as usize]).collect();
        let gradient = parts.energy == Energy::LaplacianGradient;
        let lambda: Vec<u32> = match (gradient, retained) {
            (false, _) => Vec::new(),
            (true, false) => {
                let has = |i: usize| used[i] && near[i] && (!parts.bent[i] || parts.slack[i] > 0.0);
                all.filter(|&i| has(i as usize)).collect()
            }
            (true, true) => all.filter(|&i| near[i as usize] && used[i as usize]).collect(),
        };
        if retained {
            check_determined(parts)?;
        }
        let offsets = [0, v.len(), v.len() + parts.free.len()];
        let place = |list: &[u32], offset: usize| {
            let mut at = vec![NONE; count];
            list.iter().enumerate().for_each(|(k, &i)| at[i as usize] = (offset + k) as u32);
            at
        };
        let layout = Layout {
            v_at: place(&v, offsets[0]),
            u_at: place(parts.free, offsets[1]),
            lambda_at: place(&lambda, offsets[2]),
            v,
            u: parts.free.to_vec(),
            lambda,
            bent: parts.bent.to_vec(),
            lumped,
        };
        let matrix = assemble(parts, &matrix_of_mass, &layout);
        let lu = Lu::new(&matrix).map_err(|error| match error {
            FactorError::OutOfMemory => FairingError::OutOfMemory { unknowns: matrix.rows() },
            FactorError::Singular if retained => singular(parts),
            FactorError::Singular => FairingError::Breakdown { slivers: parts.elements.slivers() },
        })?;
        let system = Self { energy: parts.energy, mass: matrix_of_mass, matrix, lu, layout };
        if retained {
            system.check_solvable(parts)?;
        }
        Ok(system)
    }

    /// A right-hand side without meaning shows whether the matrix is singular.
    fn check_solvable(&self, parts: &Parts<'_>) -> Result<(), FairingError> {
        let right: Vec<f64> = (0..self.matrix.rows()).map(|k| ((k * 7919) % 1000) as f64 / 500.0 - 1.0).collect();
        let (_, residual) =
            self.refine(&right).map_err(|_| FairingError::OutOfMemory { unknowns: self.matrix.rows() })?;
        if residual < SOLVED { Ok(()) } else { Err(singular(parts)) }
    }

    /// Replaces the free values of each `known.u`; returns the largest residual.
    pub(super) fn solve(&self, laplacian: &SparseMatrix, known: &mut [Known]) -> Result<f64, FactorError> {
        known.iter_mut().try_fold(0.0_f64, |most, component| Ok(most.max(self.solve_one(laplacian, component)?)))
    }

    fn solve_one(&self, laplacian: &SparseMatrix, known: &mut Known) -> Result<f64, FactorError> {
        let right = self.right_hand_side(laplacian, known);
        let (x, residual) = self.refine(&right)?;
        for (k, &vertex) in self.layout.u.iter().enumerate() {
            known.u[vertex as usize] += x[self.layout.v.len() + k];
        }
        Ok(residual)
    }

    /// The equations of the known values alone, on the other side. Free values keep their first guess, so that what is
    /// solved for is small.
    fn right_hand_side(&self, laplacian: &SparseMatrix, known: &Known) -> Vec<f64> {
        let layout = &self.layout;
        let stiff = laplacian.multiply(&known.u);
        // Where the mass is lumped, v is known beyond the reach of the free vertices.
        let mut v: Vec<f64> = (0..known.u.len()).map(|i| if layout.bent[i] { known.v[i] } else { 0.0 }).collect();
        let masses = self.mass.diagonal();
        if layout.lumped {
            for i in (0..v.len()).filter(|&i| !layout.bent[i] && layout.v_at[i] == NONE && masses[i] > 0.0) {
                v[i] = (stiff[i] + known.flux[i]) / masses[i];
            }
        }
        let mass_v = self.mass.multiply(&v);
        let stiff_v = laplacian.multiply(&v);
        let mut right = vec![0.0; self.matrix.rows()];
        let tested = |i: usize| -stiff[i] - known.flux[i] + mass_v[i];
        if self.energy == Energy::Laplacian {
            layout.v.iter().enumerate().for_each(|(k, &i)| right[k] = tested(i as usize));
            let offset = layout.v.len();
            layout
                .u
                .iter()
                .enumerate()
                .for_each(|(k, &i)| right[offset + k] = known.source[i as usize] - stiff_v[i as usize]);
        } else {
            layout.v.iter().enumerate().for_each(|(k, &i)| right[k] = -stiff_v[i as usize]);
            let offset = layout.v.len();
            layout.u.iter().enumerate().for_each(|(k, &i)| right[offset + k] = known.source[i as usize]);
            let offset = offset + layout.u.len();
            layout.lambda.iter().enumerate().for_each(|(k, &i)| right[offset + k] = tested(i as usize));
        }
        right
    }

    fn refine(&self, right: &[f64]) -> Result<(Vec<f64>, f64), FactorError> {
        let mut x = vec![0.0; right.len()];
        let mut best = (x.clone(), f64::INFINITY);
        for _ in 0..=STEPS {
            let product = self.matrix.multiply(&x);
            let mut size = vec![0.0; right.len()];
            for (column, value) in x.iter().enumerate() {
                self.matrix.column(column).for_each(|(row, entry)| size[row] += (entry * value).abs());
            }
            let mut left: Vec<f64> = right.iter().zip(&product).map(|(b, ax)| b - ax).collect();
            let most = |list: &[f64]| list.iter().map(|x| x.abs()).fold(0.0, f64::max);
            let terms = most(&size) + most(right);
            let residual = if terms > 0.0 { most(&left) / terms } else { 0.0 };
            // Not a number is never better.
            let is_better = residual < 0.5 * best.1;
            if !is_better {
                break;
            }
            best = (x.clone(), residual);
            self.lu.solve_in_place(&mut left)?;
            x.iter_mut().zip(&left).for_each(|(x, step)| *x += step);
        }
        Ok(best)
    }
}

fn diagonal(values: &[f64]) -> SparseMatrix {
    let entries: Vec<(u32, u32, f64)> = values.iter().enumerate().map(|(i, &m)| (i as u32, i as u32, m)).collect();
    SparseMatrix::from_triplets(values.len(), values.len(), &entries).unwrap_or_default()
}

fn assemble(parts: &Parts<'_>, mass: &SparseMatrix, layout: &Layout) -> SparseMatrix {
    let mut entries: Vec<(u32, u32, f64)> = Vec::new();
    // A block of a symmetric matrix, and its transpose.
    let mut block = |matrix: &SparseMatrix, rows: &[u32], columns: &[u32], sign: f64, mirrored: bool| {
        for (column, &at) in columns.iter().enumerate().filter(|(_, at)| **at != NONE) {
            for (row, value) in matrix.column(column).filter(|(row, _)| rows[*row] != NONE) {
                entries.push((rows[row], at, sign * value));
                if mirrored {
                    entries.push((at, rows[row], sign * value));
                }
            }
        }
    };
    if parts.energy == Energy::Laplacian {
        block(mass, &layout.v_at, &layout.v_at, -1.0, false);
        block(parts.laplacian, &layout.v_at, &layout.u_at, 1.0, true);
    } else {
        block(parts.laplacian, &layout.v_at, &layout.v_at, 1.0, false);
        block(parts.laplacian, &layout.lambda_at, &layout.u_at, 1.0, true);
        block(mass, &layout.lambda_at, &layout.v_at, -1.0, true);
        for &vertex in layout.lambda.iter().filter(|&&v| parts.slack[v as usize] > 0.0) {
            let at = layout.lambda_at[vertex as usize];
            entries.push((at, at, parts.slack[vertex as usize]));
        }
    }
    let count = layout.v.len() + layout.u.len() + layout.lambda.len();
    SparseMatrix::from_triplets(count, count, &entries).unwrap_or_default()
}

/// Bent vertices with a free neighbour, and those neighbours of each.
fn beside(parts: &Parts<'_>) -> Vec<(u32, Vec<u32>)> {
    let is_free = |row: &usize| matches!(parts.roles[*row], Role::Free(_));
    (0..parts.roles.len())
        .filter(|&v| parts.bent[v])
        .map(|v| (v as u32, parts.laplacian.column(v).map(|(row, _)| row).filter(is_free).map(|r| r as u32).collect()))
        .filter(|(_, free): &(u32, Vec<u32>)| !free.is_empty())
        .collect()
}

/// Two bent vertices that meet only one free vertex give it two equations (thesis, proposition 2); more of them than free
/// vertices beside them do so together.
fn check_determined(parts: &Parts<'_>) -> Result<(), FairingError> {
    let rows = beside(parts);
    let mut alone: Vec<(u32, u32)> =
        rows.iter().filter(|(_, free)| free.len() == 1).map(|(v, free)| (free[0], *v)).collect();
    alone.sort_unstable();
    let FairingError::Singular { held, beside } = singular(parts) else { return Ok(()) };
    if let Some(pair) = alone.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(FairingError::OverDetermined { held, beside, pair: [pair[0].1, pair[1].1], only: pair[0].0 });
    }
    if held > beside { Err(FairingError::Singular { held, beside }) } else { Ok(()) }
}

fn singular(parts: &Parts<'_>) -> FairingError {
    let rows = beside(parts);
    let mut free: Vec<u32> = rows.iter().flat_map(|(_, free)| free.iter().copied()).collect();
    free.sort_unstable();
    free.dedup();
    FairingError::Singular { held: rows.len(), beside: free.len() }
}
