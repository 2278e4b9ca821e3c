//! The system in u alone (thesis eq. 3.12, and its like for the triharmonic equation).
//!
//! With `B = M⁻¹ L` the matrix is `Bᵀ M B` for the Laplacian energy and `-Bᵀ L B` for that of its gradient, restricted to
//! the free vertices; stabilised multipliers add `Lᵀ C⁻¹ L` over bent vertices. It is never multiplied with: residuals go
//! through L and M one after the other, which keeps more digits.

use armature_geometry::operators::{Lumping, SparseMatrix};

use super::conditions::Role;
use super::error::FairingError;
use super::problem::{Energy, Known, Parts};
use crate::sparse::{Cholesky, FactorError};

/// Solves with the same factor until the residual stops falling, at most so often.
const STEPS: usize = 4;
/// A residual that another step would hardly make smaller.
const ENOUGH: f64 = 1e-15;

#[derive(Debug)]
pub(super) struct ReducedSystem {
    energy: Energy,
    mass: Vec<f64>,
    free: Vec<u32>,
    bent: Vec<bool>,
    slack: Vec<f64>,
    factor: Cholesky,
}

impl ReducedSystem {
    pub(super) fn factorise(parts: &Parts<'_>, lumping: Lumping) -> Result<Self, FairingError> {
        let mass = parts.elements.lumped(lumping);
        check_masses(parts, &mass)?;
        let (starts, rows, values) = upper_triangle(parts, &mass);
        let factor = Cholesky::of_upper(&starts, &rows, &values).map_err(|error| match error {
            FactorError::Singular => FairingError::Breakdown { slivers: parts.elements.slivers() },
            FactorError::OutOfMemory => FairingError::OutOfMemory { unknowns: parts.free.len() },
        })?;
        let (free, bent, slack) = (parts.free.to_vec(), parts.bent.to_vec(), parts.slack.to_vec());
        Ok(Self { energy: parts.energy, mass, free, bent, slack, factor })
    }

    /// Replaces the free values of each `known.u`, all components with one pass through the factor; returns the largest
    /// residual.
    pub(super) fn solve(&self, laplacian: &SparseMatrix, known: &mut [Known]) -> Result<f64, FactorError> {
        let sign = if self.energy == Energy::Laplacian { -1.0 } else { 1.0 };
        let mut best = (f64::INFINITY, Vec::new());
        for _ in 0..=STEPS {
            let mut residual = 0.0_f64;
            let mut steps: Vec<f64> = Vec::with_capacity(known.len() * self.free.len());
            for component in known.iter() {
                let (left, size) = self.equations(laplacian, component);
                let most = |values: &[f64]| self.free.iter().map(|&v| values[v as usize].abs()).fold(0.0, f64::max);
                let (error, terms) = (most(&left), most(&size));
                if !error.is_finite() || !terms.is_finite() {
                    residual = f64::INFINITY;
                } else if terms > 0.0 {
                    residual = residual.max(error / terms);
                }
                steps.extend(self.free.iter().map(|&v| sign * left[v as usize]));
            }
            if residual >= 0.5 * best.0 {
                break;
            }
            let values = known.iter().flat_map(|component| self.free.iter().map(|&v| component.u[v as usize]));
            best = (residual, values.collect());
            if residual < ENOUGH {
                break;
            }
            self.factor.solve_in_place(&mut steps)?;
            for (component, steps) in known.iter_mut().zip(steps.chunks_exact(self.free.len())) {
                self.free.iter().zip(steps).for_each(|(&v, step)| component.u[v as usize] += step);
            }
        }
        for (component, values) in known.iter_mut().zip(best.1.chunks_exact(self.free.len())) {
            self.free.iter().zip(values).for_each(|(&v, value)| component.u[v as usize] = *value);
        }
        Ok(best.0)
    }

    /// `Δᵏu - g`, tested with every hat function, and the sum of the terms' sizes.
    fn equations(&self, laplacian: &SparseMatrix, known: &Known) -> (Vec<f64>, Vec<f64>) {
        let (mut value, mut size) = product(laplacian, &known.u, &known.u);
        for (v, flux) in known.flux.iter().enumerate() {
            value[v] += flux;
            size[v] += flux.abs();
        }
        let bent = || (0..self.bent.len()).filter(|&v| self.bent[v]);
        let multiplier = |v: usize, value: f64, size: f64| match self.slack[v] {
            0.0 => (0.0, 0.0),
            slack => ((self.mass[v] * known.v[v] - value) / slack, (self.mass[v] * known.v[v].abs() + size) / slack),
        };
        let multipliers: Vec<(f64, f64)> = bent().map(|v| multiplier(v, value[v], size[v])).collect();
        self.divide(&mut value, &mut size);
        for v in bent() {
            (value[v], size[v]) = (known.v[v], known.v[v].abs());
        }
        let (mut value, mut size) = product(laplacian, &value, &size);
        if self.energy == Energy::LaplacianGradient {
            self.divide(&mut value, &mut size);
            for (v, multiplier) in bent().zip(multipliers) {
                (value[v], size[v]) = multiplier;
            }
            (value, size) = product(laplacian, &value, &size);
        }
        for (v, source) in known.source.iter().enumerate() {
            value[v] -= source;
            size[v] += source.abs();
        }
        (value, size)
    }

    /// Multiplies by the inverse mass. Vertices without area are far from anything free, and count as nothing.
    fn divide(&self, value: &mut [f64], size: &mut [f64]) {
        for (v, &mass) in self.mass.iter().enumerate() {
            let inverse = if mass > 0.0 { 1.0 / mass } else { 0.0 };
            value[v] *= inverse;
            size[v] *= inverse;
        }
    }
}

/// `L x`, and `|L| |y|`.
fn product(laplacian: &SparseMatrix, x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (starts, rows, entries) = (laplacian.column_starts(), laplacian.row_indices(), laplacian.values());
    // The matrix is symmetric: each column is a row.
    (0..x.len())
        .map(|column| {
            let range = starts[column]..starts[column + 1];
            let terms = rows[range.clone()].iter().zip(&entries[range]);
            terms.fold((0.0, 0.0), |(value, size), (&row, entry)| {
                (value + entry * x[row], size + (entry * y[row]).abs())
            })
        })
        .unzip()
}

/// Vertices whose mass is divided by have one.
fn check_masses(parts: &Parts<'_>, mass: &[f64]) -> Result<(), FairingError> {
    let touching = parts.free.iter().flat_map(|&v| parts.laplacian.column(v as usize).map(|(row, _)| row));
    match touching.into_iter().find(|&row| mass[row] <= 0.0) {
        Some(row) => Err(FairingError::NoArea { vertex: row as u32 }),
        None => Ok(()),
    }
}

/// A sparse vector that is filled, read and emptied again and again.
struct Scatter {
    values: Vec<f64>,
    is_in: Vec<bool>,
    places: Vec<u32>,
}

impl Scatter {
    fn new(count: usize) -> Self {
        Self { values: vec![0.0; count], is_in: vec![false; count], places: Vec::new() }
    }

    fn add(&mut self, place: usize, value: f64) {
        if !std::mem::replace(&mut self.is_in[place], true) {
            self.places.push(place as u32);
        }
        self.values[place] += value;
    }

    /// Adds `L x`, `x` being empty afterwards. Rows for which `keep` is false are left out.
    fn add_product(&mut self, laplacian: &SparseMatrix, x: &mut Self, keep: impl Fn(usize) -> bool) {
        for &place in &x.places {
            let factor = x.values[place as usize];
            laplacian
                .column(place as usize)
                .filter(|(row, _)| keep(*row))
                .for_each(|(row, l)| self.add(row, l * factor));
        }
        x.clear();
    }

    fn clear(&mut self) {
        for &place in &self.places {
            self.values[place as usize] = 0.0;
            self.is_in[place as usize] = false;
        }
        self.places.clear();
    }

    fn divide(&mut self, mass: &[f64]) {
        self.places.iter().for_each(|&place| self.values[place as usize] /= mass[place as usize]);
    }
}

/// The upper triangle of the matrix, over free vertices, rows ascending.
fn upper_triangle(parts: &Parts<'_>, mass: &[f64]) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
    let count = mass.len();
    let unbent = |row: usize| !parts.bent[row];
    let (mut from, mut to) = (Scatter::new(count), Scatter::new(count));
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for (column, &vertex) in parts.free.iter().enumerate() {
        from.clear();
        from.add(vertex as usize, 1.0);
        let stabilised: Vec<(usize, f64)> = parts
            .laplacian
            .column(vertex as usize)
            .filter(|&(row, _)| parts.slack[row] > 0.0)
            .map(|(row, l)| (row, -l / parts.slack[row]))
            .collect();
        to.add_product(parts.laplacian, &mut from, unbent);
        to.divide(mass);
        std::mem::swap(&mut from, &mut to);
        let mut sign = 1.0;
        if parts.energy == Energy::LaplacianGradient {
            // Only rows beside a free vertex are multiplied with again; others may have no mass.
            to.add_product(parts.laplacian, &mut from, |row| unbent(row) && mass[row] > 0.0);
            to.divide(mass);
            stabilised.iter().for_each(|&(row, multiplier)| to.add(row, multiplier));
            std::mem::swap(&mut from, &mut to);
            sign = -1.0;
        }
        to.add_product(parts.laplacian, &mut from, |row| matches!(parts.roles[row], Role::Free(_)));
        let mut entries: Vec<(usize, f64)> = to
            .places
            .iter()
            .filter_map(|&place| match parts.roles[place as usize] {
                Role::Free(row) if row as usize <= column => Some((row as usize, sign * to.values[place as usize])),
                _ => None,
            })
            .collect();
        to.clear();
        entries.sort_unstable_by_key(|&(row, _)| row);
        rows.extend(entries.iter().map(|&(row, _)| row));
        values.extend(entries.iter().map(|&(_, value)| value));
        starts.push(rows.len());
    }
    (starts, rows, values)
}
