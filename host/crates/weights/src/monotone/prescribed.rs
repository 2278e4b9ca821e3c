//! What a monotone function is asked for.

/// What a vertex with a given value is to the function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Lower than everything around it, except connected minima of the same value.
    Minimum,
    /// Like any other vertex: with a lower and a higher neighbour.
    Between,
    /// Higher than everything around it, except connected maxima of the same value.
    Maximum,
}

/// The given values of one function.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrescribedFunction {
    /// One for each fixed vertex.
    pub values: Vec<f64>,
    /// One for each fixed vertex.
    pub roles: Vec<Role>,
}

impl PrescribedFunction {
    /// The lowest given values are minima, the highest are maxima, and all others lie between.
    pub fn between_extremes(values: &[f64]) -> Self {
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let role = |&value: &f64| {
            if value >= highest {
                Role::Maximum
            } else if value <= lowest {
                Role::Minimum
            } else {
                Role::Between
            }
        };
        Self { values: values.to_vec(), roles: values.iter().map(role).collect() }
    }
}
