//! What it costs that bones are rigid.

/// Energies of a pose, in square mesh units for the energy of the surface, cubic ones for that of the volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitCost {
    /// What the minimiser reached, with bones that stretch and shear.
    pub minimiser: f64,
    /// With the bones as they were posed.
    pub posed: f64,
}
