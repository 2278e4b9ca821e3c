//! Topology-aware smoothing (thesis 5.3.3; Weinkauf et al. 2010): data lose their noise, and of their extrema exactly those
//! that matter stay, where they are and with their values.
//!
//! The paper's representative function is harmonic between the separatrices of the simplified Morse-Smale complex. Here it
//! is the data's own order, simplified until it has the kept extrema only (see
//! [`order_with_extrema`](crate::extrema::order_with_extrema)): it follows the shape of the data everywhere, and needs no
//! complex.

use std::ops::ControlFlow;

use super::error::MonotoneError;
use super::monotone_functions::{MonotoneFunction, MonotoneSettings, monotone_functions};
use super::prescribed::{PrescribedFunction, Role};
use super::problem::{Data, MonotoneProblem};
use crate::extrema::{PersistentExtremum, persistence};

/// Which extrema stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// This many, the most persistent; at least two.
    Most(usize),
    /// Those at least this persistent, in units of the data.
    Persistence(f64),
}

/// Smoothed data.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// The function and its report.
    pub function: MonotoneFunction,
    /// The extrema that were kept, most persistent first.
    pub kept: Vec<PersistentExtremum>,
    /// How many there were.
    pub before: usize,
}

/// Smooths `data` with the mesh, order and blend of `problem`, whose own data term is not used. Every piece of the mesh
/// must keep a minimum and a maximum, unless the data are constant there.
pub fn smooth_keeping(
    problem: &MonotoneProblem<'_>,
    data: Data<'_>,
    keep: Keep,
    settings: &MonotoneSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Smoothed, MonotoneError> {
    let mut kept = persistence(problem.neighbours, data.values)?;
    let (before, most) = (kept.len(), kept.first().map_or(0.0, |first| first.persistence));
    match keep {
        Keep::Most(count) if count >= 2 => kept.truncate(count),
        Keep::Most(count) => {
            let (what, value) = ("the number of extrema to keep", count as f64);
            return Err(MonotoneError::BadNumber { what, value, allowed: "at least 2" });
        }
        Keep::Persistence(least) if least >= 0.0 => kept.retain(|extremum| extremum.persistence >= least),
        Keep::Persistence(value) => {
            return Err(MonotoneError::BadNumber { what: "the persistence", value, allowed: "not negative" });
        }
    }
    let both = kept.iter().any(|extremum| extremum.is_minimum) && kept.iter().any(|extremum| !extremum.is_minimum);
    if before > 0 && !both {
        return Err(MonotoneError::NothingKept { most });
    }
    let role = |extremum: &PersistentExtremum| if extremum.is_minimum { Role::Minimum } else { Role::Maximum };
    let prescribed = PrescribedFunction {
        values: kept.iter().map(|extremum| extremum.value).collect(),
        roles: kept.iter().map(role).collect(),
    };
    let fixed: Vec<usize> = kept.iter().map(|extremum| extremum.vertex).collect();
    let problem = MonotoneProblem { data: Some(data), ..*problem };
    let mut made = monotone_functions(&problem, &fixed, &[prescribed], settings, progress)?;
    let mut function = made.remove(0);
    // Where the data are constant, or nothing is kept, they stay what they are.
    let mut is_kept = vec![false; data.values.len()];
    fixed.iter().for_each(|&vertex| is_kept[vertex] = true);
    for piece in problem.neighbours.pieces().iter().filter(|piece| !piece.iter().any(|&vertex| is_kept[vertex])) {
        piece.iter().for_each(|&vertex| function.values[vertex] = data.values[vertex]);
    }
    Ok(Smoothed { function, kept, before })
}
