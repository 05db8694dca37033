//! The phases of a precomputation, told to whoever waits for it. What each takes is for the listener's clock.

/// What a precomputation is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stiffness from the elements.
    Assembly,
    /// Fill-reducing order, structure of the factor, and what of it is needed.
    Ordering,
    /// The factor, and the operators of the sweeps from it.
    Factor,
    /// How accurate answers will be.
    Accuracy,
    /// Columns, block by block.
    Columns,
    /// The store from the blocks.
    Store,
}

impl Phase {
    /// As a user reads it.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Assembly => "assembling",
            Phase::Ordering => "ordering",
            Phase::Factor => "factorising",
            Phase::Accuracy => "measuring accuracy",
            Phase::Columns => "columns",
            Phase::Store => "writing",
        }
    }
}

/// Called as each phase begins.
pub type Listener<'a> = &'a (dyn Fn(Phase) + Sync);
