//! Displacement of a half-space under uniform pressure on the cells of a regular grid.
//!
//! Love (The stress produced in a semi-infinite solid by pressure on part of the boundary, 1929; Johnson, Contact
//! Mechanics, 1985, eq. 3.25): a pressure `p` on the rectangle `|x| < a, |y| < b` lifts the surface at `(x, y)` by
//!
//! ```text
//! u = p/(pi E*) [F(x + a, y + b) - F(x - a, y + b) - F(x + a, y - b) + F(x - a, y - b)]
//! F(x, y) = x asinh(y/|x|) + y asinh(x/|y|)
//! ```
//!
//! `F` is homogeneous: in cells of sides `hx` and `hy = alpha hx`, with forces in place of pressures,
//! `u_i = sum_j T(i - j) f_j/(pi E* sqrt(hx hy))`, where `T` depends on `alpha` only. `T` is symmetric to the bit.

use crate::math::log;
use glam::{DMat4, DVec4};
use pulp::{Arch, NullaryFnOnce};

/// Most cells along a side of the grid.
pub const MAX_CELLS: usize = 16;
/// Offsets between cells of a row, from `-15` to `15`, filled up to a whole number of vectors.
const OFFSETS: usize = 2 * MAX_CELLS;

/// A number for each cell, row by row.
pub type Grid = [[f64; MAX_CELLS]; MAX_CELLS];
pub const ZERO: Grid = [[0.0; MAX_CELLS]; MAX_CELLS];

/// `T` or a derivative of it by distance of rows and offset of columns plus 15.
pub type Kernel = [[f64; OFFSETS]; MAX_CELLS];

/// Influence of cells on each other.
#[derive(Clone, Debug)]
pub struct Influence {
    arch: Arch,
    aspect: f64,
    cells: usize,
    kernel: Kernel,
    kernel_by_aspect: Kernel,
    stencil: [[f64; 2]; 2],
}

impl Influence {
    /// Of square cells.
    pub fn new() -> Self {
        let zero = [[0.0; OFFSETS]; MAX_CELLS];
        let mut influence = Self {
            arch: Arch::new(),
            aspect: f64::NAN,
            cells: 0,
            kernel: zero,
            kernel_by_aspect: zero,
            stencil: [[0.0; 2]; 2],
        };
        influence.set_aspect(MAX_CELLS, 1.0);
        influence
    }

    /// Prepares a grid of `cells` by `cells` of an aspect `hy/hx`; costs nothing where neither has changed.
    pub fn set_aspect(&mut self, cells: usize, aspect: f64) {
        if (cells, aspect) == (self.cells, self.aspect) {
            return;
        }
        (self.cells, self.aspect) = (cells, aspect);
        // Values and derivatives by y of F at the corners (i + 1/2, aspect (j + 1/2)).
        let (mut value, mut by_y) = (ZERO, ZERO);
        for j in 0..self.cells {
            let y = aspect * (j as f64 + 0.5);
            for i in 0..self.cells {
                let x = i as f64 + 0.5;
                let r = (x * x + y * y).sqrt();
                by_y[j][i] = log((x + r) / y);
                value[j][i] = x * log((y + r) / x) + y * by_y[j][i];
            }
        }
        self.fill(&value, &by_y);
        self.stencil = self.local_inverse();
    }

    /// Kernels from values and derivatives at the corners.
    fn fill(&mut self, value: &Grid, by_y: &Grid) {
        let (aspect, root) = (self.aspect, self.aspect.sqrt());
        for j in 0..self.cells {
            for i in 0..self.cells {
                // F is odd in x and in y, its derivative by y even in y.
                let (left, below) = (i.checked_sub(1), j.checked_sub(1));
                let at = |f: &Grid, i: Option<usize>, j: Option<usize>, odd: f64| {
                    let sign = if i.is_none() { -1.0 } else { 1.0 } * if j.is_none() { odd } else { 1.0 };
                    sign * f[j.unwrap_or(0)][i.unwrap_or(0)]
                };
                let (right, above) = (Some(i), Some(j));
                let sum = at(value, right, above, -1.0) - at(value, left, above, -1.0) - at(value, right, below, -1.0)
                    + at(value, left, below, -1.0);
                let upper = (j as f64 + 0.5) * (at(by_y, right, above, 1.0) - at(by_y, left, above, 1.0));
                let lower = (j as f64 - 0.5) * (at(by_y, right, below, 1.0) - at(by_y, left, below, 1.0));
                let (influence, by_aspect) = (sum / root, (upper - lower - 0.5 * sum / aspect) / root);
                for column in [MAX_CELLS - 1 + i, MAX_CELLS - 1 - i] {
                    self.kernel[j][column] = influence;
                    self.kernel_by_aspect[j][column] = by_aspect;
                }
            }
        }
    }

    /// Rows of the inverse of `T` on a cell and its eight neighbours, by distance in rows and in columns.
    ///
    /// `T` falls off with distance as `1/r`, so its inverse like the root of the Laplacian is nearly local.
    fn local_inverse(&self) -> [[f64; 2]; 2] {
        let t = |i: usize, j: usize| self.kernel[j][MAX_CELLS - 1 + i];
        let folded = DMat4::from_cols_array(&[
            t(0, 0),
            t(1, 0),
            t(0, 1),
            t(1, 1),
            2.0 * t(1, 0),
            t(0, 0) + t(2, 0),
            2.0 * t(1, 1),
            t(0, 1) + t(2, 1),
            2.0 * t(0, 1),
            2.0 * t(1, 1),
            t(0, 0) + t(0, 2),
            t(1, 0) + t(1, 2),
            4.0 * t(1, 1),
            2.0 * (t(0, 1) + t(2, 1)),
            2.0 * (t(1, 0) + t(1, 2)),
            t(0, 0) + t(2, 0) + t(0, 2) + t(2, 2),
        ]);
        let [middle, beside, above, across] = (folded.inverse() * DVec4::X).to_array();
        [[middle, beside], [above, across]]
    }

    /// An approximate `T^-1 r`, symmetric and positive definite on any set of cells, where `r` is zero outside of the set.
    pub fn precondition(&self, cells: usize, r: &Grid, out: &mut Grid) {
        self.arch.dispatch(Stencil { stencil: &self.stencil, cells, r, out });
    }

    /// `T q` on the first `cells` rows.
    pub fn product(&self, cells: usize, q: &Grid, out: &mut Grid) {
        self.arch.dispatch(Product { kernel: &self.kernel, cells, q, out });
    }

    /// `dT/dalpha q` on the first `cells` rows.
    pub fn product_by_aspect(&self, cells: usize, q: &Grid, out: &mut Grid) {
        self.arch.dispatch(Product { kernel: &self.kernel_by_aspect, cells, q, out });
    }
}

/// The product as a struct: a closure might be compiled for the narrowest vectors.
struct Product<'a> {
    kernel: &'a Kernel,
    cells: usize,
    q: &'a Grid,
    out: &'a mut Grid,
}

impl NullaryFnOnce for Product<'_> {
    type Output = ();

    /// Two rows at once hide the latency of additions. Cells without pressure are skipped.
    #[inline(always)]
    fn call(self) {
        for pair in 0..self.cells.div_ceil(2) {
            let (first, second) = (2 * pair, 2 * pair + 1);
            let (mut a, mut b) = ([0.0; MAX_CELLS], [0.0; MAX_CELLS]);
            for (row, sources) in self.q.iter().enumerate().take(self.cells) {
                let (near, far) = (&self.kernel[first.abs_diff(row)], &self.kernel[second.abs_diff(row)]);
                for (column, &source) in sources.iter().enumerate().take(self.cells) {
                    if source == 0.0 {
                        continue;
                    }
                    let start = MAX_CELLS - 1 - column;
                    let (near, far) = (&near[start..start + MAX_CELLS], &far[start..start + MAX_CELLS]);
                    for i in 0..MAX_CELLS {
                        a[i] += source * near[i];
                    }
                    for i in 0..MAX_CELLS {
                        b[i] += source * far[i];
                    }
                }
            }
            self.out[first] = a;
            self.out[second] = b;
        }
    }
}

/// Sums over neighbours.
struct Stencil<'a> {
    stencil: &'a [[f64; 2]; 2],
    cells: usize,
    r: &'a Grid,
    out: &'a mut Grid,
}

impl NullaryFnOnce for Stencil<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        const NONE: &[f64; MAX_CELLS] = &[0.0; MAX_CELLS];
        let [[middle, beside], [above, across]] = *self.stencil;
        for j in 0..self.cells {
            let (row, next) = (&self.r[j], if j + 1 < self.cells { &self.r[j + 1] } else { NONE });
            let before = if j > 0 { &self.r[j - 1] } else { NONE };
            // Rows above and below count alike.
            let mut rows = [0.0; MAX_CELLS + 2];
            let mut own = [0.0; MAX_CELLS + 2];
            for i in 0..MAX_CELLS {
                rows[i + 1] = before[i] + next[i];
                own[i + 1] = row[i];
            }
            for i in 0..MAX_CELLS {
                self.out[j][i] = middle * own[i + 1]
                    + beside * (own[i] + own[i + 2])
                    + above * rows[i + 1]
                    + across * (rows[i] + rows[i + 2]);
            }
        }
    }
}
