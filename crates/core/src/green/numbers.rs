//! Typed columns in memory, and the loops over them.
//!
//! A loop is written once for the three formats and dispatched once a call, for the format and for the processor's
//! vectors. Products are never fused with sums: the same bits on every processor.

use bytemuck::Pod;
use pulp::{Arch, NullaryFnOnce};

use super::precision::Precision;
use crate::{Error, Result};

/// A number as it is stored.
pub trait Stored: Pod + Into<f64> {
    /// Its value, before the scales of [`Precision::F16`].
    #[inline(always)]
    fn value(self) -> f64 {
        self.into()
    }
}

impl Stored for i16 {}
impl Stored for f32 {}
impl Stored for f64 {}

/// Columns in memory, one after the other.
pub enum Numbers {
    /// Fixed point, to be scaled.
    F16(Vec<i16>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

/// A loop over stored numbers.
pub trait Kernel {
    /// What it finds.
    type Output;
    /// The loop; always inlined into the dispatch.
    fn run<T: Stored>(self, numbers: &[T]) -> Self::Output;
}

struct KernelCall<'a, K, T>(K, &'a [T]);

impl<K: Kernel, T: Stored> NullaryFnOnce for KernelCall<'_, K, T> {
    type Output = K::Output;
    #[inline(always)]
    fn call(self) -> K::Output {
        self.0.run(self.1)
    }
}

/// Numbers behind the last one, so that the three of a node are read as four.
const PADDING: usize = 1;

impl Numbers {
    /// Zeros in place of `count` numbers.
    pub fn zeros(precision: Precision, count: usize) -> Self {
        match precision {
            Precision::F16 => Numbers::F16(vec![0; count + PADDING]),
            Precision::F32 => Numbers::F32(vec![0.0; count + PADDING]),
            Precision::F64 => Numbers::F64(vec![0.0; count + PADDING]),
        }
    }

    /// Zeros in place of `count` numbers, where memory may not be enough.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn try_zeros(precision: Precision, count: usize) -> Result<Self> {
        // What the system gives is given back at once: zeros that nobody has written yet take no memory, a copy would.
        let refused = Vec::<u8>::new().try_reserve_exact((count + PADDING) * precision.bytes());
        refused.map(|()| Self::zeros(precision, count)).map_err(|_| {
            let size = count as f64 * precision.bytes() as f64 / 1e9;
            Error::Memory(format!(
                "the system does not give the {size:.1} GB of memory that the Green's function takes: free some, or raise \
                 the limit of this process ('ulimit -v')"
            ))
        })
    }

    /// Their format.
    pub fn precision(&self) -> Precision {
        match self {
            Numbers::F16(_) => Precision::F16,
            Numbers::F32(_) => Precision::F32,
            Numbers::F64(_) => Precision::F64,
        }
    }

    /// The bytes of all of them.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Numbers::F16(v) => bytemuck::cast_slice(&v[..v.len() - PADDING]),
            Numbers::F32(v) => bytemuck::cast_slice(&v[..v.len() - PADDING]),
            Numbers::F64(v) => bytemuck::cast_slice(&v[..v.len() - PADDING]),
        }
    }

    /// The bytes of all of them, to be filled.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        match self {
            Numbers::F16(v) => unpadded_mut(v),
            Numbers::F32(v) => unpadded_mut(v),
            Numbers::F64(v) => unpadded_mut(v),
        }
    }

    /// Runs a loop over them, padding included.
    pub fn run<K: Kernel>(&self, arch: Arch, kernel: K) -> K::Output {
        match self {
            Numbers::F16(v) => arch.dispatch(KernelCall(kernel, v)),
            Numbers::F32(v) => arch.dispatch(KernelCall(kernel, v)),
            Numbers::F64(v) => arch.dispatch(KernelCall(kernel, v)),
        }
    }
}

fn unpadded_mut<T: Pod>(numbers: &mut [T]) -> &mut [u8] {
    let end = numbers.len() - PADDING;
    bytemuck::cast_slice_mut(&mut numbers[..end])
}

/// A node as row of a weighted sum: its first number in a column, and what its three numbers are multiplied by.
#[derive(Clone, Copy, Default)]
pub struct WeightedRow {
    /// Offset in a column.
    pub at: usize,
    /// Weight times the factors of the node's dofs; the fourth is not used.
    pub weights: [f64; 4],
}

/// `sum_i w_i Psi_ij` over rows `i` for the three columns that begin at `starts`; the fourth number of each is of no use.
#[inline(always)]
pub fn column_sums<T: Stored>(numbers: &[T], starts: [usize; 3], rows: &[WeightedRow]) -> [[f64; 4]; 3] {
    let mut sums = [[0.0; 4]; 3];
    let columns = starts.map(|start| &numbers[start..]);
    for row in rows {
        for (sum, column) in sums.iter_mut().zip(columns) {
            let values = &column[row.at..row.at + 4];
            for k in 0..4 {
                sum[k] += row.weights[k] * values[k].value();
            }
        }
    }
    sums
}

/// One entry.
pub struct One(pub usize);

impl Kernel for One {
    type Output = f64;
    #[inline(always)]
    fn run<T: Stored>(self, numbers: &[T]) -> f64 {
        numbers[self.0].value()
    }
}

/// Copies the three numbers of nodes out of columns.
pub struct Gather<'a> {
    /// Offsets of the nodes in a column.
    pub rows: &'a [usize],
    /// Where the columns begin.
    pub starts: &'a [usize],
    /// Column after column, three numbers a node.
    pub out: &'a mut [f64],
}

impl Kernel for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Stored>(self, numbers: &[T]) {
        for (out, &start) in self.out.chunks_exact_mut(3 * self.rows.len()).zip(self.starts) {
            let column = &numbers[start..];
            for (out, &at) in out.chunks_exact_mut(3).zip(self.rows) {
                let values = &column[at..at + 3];
                for k in 0..3 {
                    out[k] = values[k].value();
                }
            }
        }
    }
}

/// Columns that one pass of [`AddColumns`] takes: each pass reads and writes the sums once.
pub const COLUMNS_AT_ONCE: usize = 4;

/// `sums += sum_c factor_c column_c`.
pub struct AddColumns<'a> {
    /// Where the columns begin.
    pub starts: [usize; COLUMNS_AT_ONCE],
    /// Their factors.
    pub factors: [f64; COLUMNS_AT_ONCE],
    /// Sums of the first rows.
    pub sums: &'a mut [f64],
}

impl Kernel for AddColumns<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Stored>(self, numbers: &[T]) {
        let [a, b, c, d] = self.starts.map(|start| &numbers[start..start + self.sums.len()]);
        let [fa, fb, fc, fd] = self.factors;
        for ((((sum, a), b), c), d) in self.sums.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *sum += (fa * a.value() + fb * b.value()) + (fc * c.value() + fd * d.value());
        }
    }
}
