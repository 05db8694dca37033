//! Energies of a motion: kinetic, strain, dissipated, and work done.

/// Energies, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// `v M v / 2`.
    pub kinetic: f64,
    /// `u K u / 2`.
    pub strain: f64,
    /// `f^2 / 2 k_c` of the springs between tools and the body; zero where there are none.
    pub coupling: f64,
    /// Taken out by the damping matrix since the start.
    pub dissipated: f64,
    /// Done by forces, tools and strikes since the start.
    pub work: f64,
}
