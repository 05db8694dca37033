//! The precomputed operator `Psi` and access to its entries.

use std::path::PathBuf;

use memmap2::Mmap;

use super::scaled;
use crate::mesh::Surface;

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
    /// `"f16"`, `"f32"` or `"f64"`.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F16 => "f16",
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        }
    }

    /// Largest relative error of rounding a stored number.
    pub fn unit_roundoff(self) -> f64 {
        match self {
            Precision::F16 => f64::from(2.0_f32.powi(-15)),
            Precision::F32 => f64::from(f32::EPSILON) / 2.0,
            Precision::F64 => f64::EPSILON / 2.0,
        }
    }

    /// The format called `name`.
    pub fn parse(name: &str) -> Option<Self> {
        [Precision::F16, Precision::F32, Precision::F64].into_iter().find(|p| p.name() == name)
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

/// Where the entries live; column after column.
pub enum Values {
    /// In memory, fixed point.
    F16(Vec<i16>),
    /// In memory, single.
    F32(Vec<f32>),
    /// In memory, double.
    F64(Vec<f64>),
    /// In a mapped store: the map, first byte, number of entries, format.
    Mapped(Mmap, usize, usize, Precision),
}

/// The entries as a slice.
#[derive(Clone, Copy)]
pub enum ValueSlice<'a> {
    /// Fixed point, to be scaled.
    F16(&'a [i16]),
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

impl Values {
    /// Borrow as a slice of the stored type. The alignment of a mapped store was checked when it was opened.
    pub fn as_slice(&self) -> ValueSlice<'_> {
        match self {
            Values::F16(v) => ValueSlice::F16(v),
            Values::F32(v) => ValueSlice::F32(v),
            Values::F64(v) => ValueSlice::F64(v),
            Values::Mapped(map, at, len, Precision::F16) => {
                ValueSlice::F16(bytemuck::cast_slice(&map[*at..*at + 2 * len]))
            }
            Values::Mapped(map, at, len, Precision::F32) => {
                ValueSlice::F32(bytemuck::cast_slice(&map[*at..*at + 4 * len]))
            }
            Values::Mapped(map, at, len, Precision::F64) => {
                ValueSlice::F64(bytemuck::cast_slice(&map[*at..*at + 8 * len]))
            }
        }
    }

    /// Stored format.
    pub fn precision(&self) -> Precision {
        match self {
            Values::F16(_) => Precision::F16,
            Values::F32(_) => Precision::F32,
            Values::F64(_) => Precision::F64,
            Values::Mapped(.., precision) => *precision,
        }
    }
}

/// Green's function of a body: columns of touchable surface dofs, rows of surface dofs and then of supported dofs inside.
pub struct GreensFunction {
    /// Mesh indices of the surface nodes, ascending (s).
    pub surface_nodes: Vec<u32>,
    /// The surface in its own numbering.
    pub surface: Surface,
    /// Touchable surface nodes as ascending ranks in `surface_nodes` (t); three columns each.
    pub touch: Vec<u32>,
    /// For each surface node its rank in `touch`, or `u32::MAX`.
    pub touch_rank: Vec<u32>,
    /// Fixed dofs of the mesh, ascending.
    pub fixed_dofs: Vec<u32>,
    /// For each fixed dof its row.
    pub fixed_rows: Vec<u32>,
    /// Number of rows.
    pub rows: usize,
    /// Whether each row's known is a displacement (a supported dof).
    pub row_is_fixed: Vec<bool>,
    /// The entries, columns contiguous.
    pub values: Values,
    /// Reference loads on all dofs of the mesh, N; empty for none.
    pub loads: Vec<f64>,
    /// What the reference loads alone do, on the rows: displacements, m, and `K u` on supported rows, N; empty for none.
    pub free_response: Vec<f64>,
    /// Scale of each row, and of the column that belongs to it, if the entries are scaled (`f16`).
    pub scale: Vec<f64>,
    /// Content key.
    pub key: String,
    /// Young's modulus if the whole body has one and no loads, Pa: then it only scales forces.
    pub youngs_modulus: Option<f64>,
    /// What the file was made from, in JSON, for people.
    pub description: String,
    /// The file behind it, if any.
    pub path: Option<PathBuf>,
}

impl GreensFunction {
    /// Number of surface nodes.
    pub fn surface_count(&self) -> usize {
        self.surface_nodes.len()
    }

    /// First of the three columns of surface node `node` (a rank in `surface_nodes`), if it may be touched.
    pub fn first_column(&self, node: usize) -> Option<usize> {
        match self.touch_rank[node] {
            u32::MAX => None,
            rank => Some(3 * rank as usize),
        }
    }

    /// Entry of row `row` and column `column`.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let at = column * self.rows + row;
        match self.values.as_slice() {
            // The product of the scales first: it is the same for the mirrored entry.
            ValueSlice::F16(v) => self.scale[row] * self.scale[self.row_of_column(column)] * f64::from(v[at]),
            ValueSlice::F32(v) => f64::from(v[at]),
            ValueSlice::F64(v) => v[at],
        }
    }

    /// `out += factor * Psi(0..out.len(), column)`.
    pub fn add_column(&self, column: usize, factor: f64, out: &mut [f64]) {
        let at = column * self.rows;
        match self.values.as_slice() {
            ValueSlice::F16(v) => {
                let factor = factor * self.scale[self.row_of_column(column)];
                scaled::add_scaled(&v[at..at + out.len()], factor, &self.scale, out);
            }
            ValueSlice::F32(v) => add_scaled(&v[at..at + out.len()], factor, out),
            ValueSlice::F64(v) => add_scaled(&v[at..at + out.len()], factor, out),
        }
    }

    /// Reference load on the dof of surface row `row`, N.
    pub fn load_on_row(&self, row: usize) -> f64 {
        let dof = 3 * self.surface_nodes[row / 3] as usize + row % 3;
        self.loads.get(dof).copied().unwrap_or(0.0)
    }

    /// Displacements of the surface dofs (3s) under the reference loads alone, m.
    pub fn free_displacements(&self) -> Vec<f64> {
        let mut u = vec![0.0; 3 * self.surface_count()];
        for (row, (u, &response)) in u.iter_mut().zip(&self.free_response).enumerate() {
            if !self.row_is_fixed[row] {
                *u = response;
            }
        }
        u
    }

    /// Column of the dof in row `row`, which has one.
    pub(super) fn column_of_row(&self, row: usize) -> usize {
        3 * self.touch_rank[row / 3] as usize + row % 3
    }

    /// Row of the dof in column `column`.
    pub fn row_of_column(&self, column: usize) -> usize {
        3 * self.touch[column / 3] as usize + column % 3
    }
}

fn add_scaled<T: Copy + Into<f64>>(column: &[T], factor: f64, out: &mut [f64]) {
    for (o, &c) in out.iter_mut().zip(column) {
        *o += factor * c.into();
    }
}
