//! Number formats of the stored entries.

/// Number format of the stored values; arithmetic is always f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 2 bytes an entry, fixed point with a scale a dof.
    F16,
    /// 4 bytes an entry.
    F32,
    /// 8 bytes an entry.
    F64,
}

impl Precision {
    /// All, the cheapest first.
    pub const ALL: [Precision; 3] = [Precision::F16, Precision::F32, Precision::F64];

    /// `"f16"`, `"f32"` or `"f64"`.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F16 => "f16",
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }

    /// Largest error of rounding an entry `Psi_ij`: relative to it, of F16 relative to its bound `s_i s_j`.
    pub fn unit_roundoff(self) -> f64 {
        match self {
            Precision::F16 => f64::from(2.0_f32.powi(-16)),
            Precision::F32 => f64::from(f32::EPSILON) / 2.0,
            Precision::F64 => f64::EPSILON / 2.0,
        }
    }

    /// The format called `name`.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// Bytes of a stored entry.
    pub fn bytes(self) -> usize {
        match self {
            Precision::F16 => 2,
            Precision::F32 => 4,
            Precision::F64 => 8,
        }
    }

    /// Bytes of an entry on its way into the store.
    pub fn panel_bytes(self) -> usize {
        self.bytes().max(4)
    }

    /// Bytes of the numbers that columns are computed with. Single precision costs a column up to 1e-5 of its largest
    /// entry, and reactions more: enough for halves only.
    pub fn computed_bytes(self) -> usize {
        if self == Precision::F16 { 4 } else { 8 }
    }
}
