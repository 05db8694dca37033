//! A function of space by quadratic B-splines on a grid.
//!
//! Its gradient is continuous, so that forces are. Linear interpolation would make every grid plane a crease; cubic splines take
//! 64 coefficients in place of 27.

use glam::{DMat3, DVec3};

/// Grid cells around the box that a grid covers: the spline needs one, a line that passes by another.
const MARGIN: f64 = 2.0;
/// Sweeps that make the spline pass through the values at the nodes; each leaves a quarter of the error at worst.
const PREFILTER_SWEEPS: usize = 12;
/// Second differences of the splines of three neighbouring nodes.
const BEND: [f64; 3] = [1.0, -2.0, 1.0];

/// Nodes of a grid, x running fastest.
#[derive(Clone)]
pub(super) struct Grid {
    /// Position of the first node, m.
    corner: DVec3,
    /// Edge of a cell, m.
    pub spacing: f64,
    nodes: [usize; 3],
}

/// A function of space.
#[derive(Clone)]
pub(super) struct Spline {
    pub grid: Grid,
    coefficients: Vec<f32>,
}

impl Grid {
    /// Around a box.
    pub fn around([low, high]: [DVec3; 2], spacing: f64) -> Self {
        let nodes = ((high - low) / spacing).to_array().map(|cells| (cells + 2.0 * MARGIN).ceil() as usize + 1);
        Self { corner: low - DVec3::splat(MARGIN * spacing), spacing, nodes }
    }

    /// Values of a function at all nodes.
    pub fn values(&self, of: impl Fn(DVec3) -> f64) -> Vec<f64> {
        let [nx, ny, nz] = self.nodes;
        let mut values = Vec::with_capacity(nx * ny * nz);
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    values.push(of(self.corner + self.spacing * DVec3::new(i as f64, j as f64, k as f64)));
                }
            }
        }
        values
    }

    /// The nearest point of the grid.
    pub fn nearest(&self, point: DVec3) -> DVec3 {
        point.clamp(self.corner, self.corner + self.spacing * DVec3::from_array(self.nodes.map(|n| (n - 1) as f64)))
    }

    /// First of the three nodes along each axis whose splines count at a point of the grid, and how far the point is from the second,
    /// in cells.
    fn splines_at(&self, point: DVec3) -> ([usize; 3], [f64; 3]) {
        let place = ((point - self.corner) / self.spacing).to_array();
        let middle = [0, 1, 2].map(|axis| place[axis].round().clamp(1.0, (self.nodes[axis] - 2) as f64));
        (middle.map(|m| m as usize - 1), [0, 1, 2].map(|axis| place[axis] - middle[axis]))
    }

    /// Number of a node.
    fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.nodes[0] * (j + self.nodes[1] * k)
    }
}

impl Spline {
    /// Through values at the nodes of a grid.
    pub fn through(grid: Grid, values: &[f64]) -> Self {
        let coefficients = prefiltered(values, grid.nodes).into_iter().map(|c| c as f32).collect();
        Self { grid, coefficients }
    }

    /// Past values at the nodes of a grid: a mean over about two cells, which rounds what is narrower.
    pub fn past(grid: Grid, values: &[f64]) -> Self {
        Self { grid, coefficients: values.iter().map(|&value| value as f32).collect() }
    }

    /// Value and gradient at a point of the grid.
    pub fn at(&self, point: DVec3) -> (f64, DVec3) {
        let ([i, first_j, first_k], offsets) = self.grid.splines_at(point);
        let [[wx, gx], [wy, gy], [wz, gz]] = offsets.map(|f| [weights(f), slopes(f)]);
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        for k in 0..3 {
            let (mut plane, mut plane_x, mut plane_y) = (0.0, 0.0, 0.0);
            for j in 0..3 {
                let Some(row) = self.row([i, first_j + j, first_k + k]) else { continue };
                let along = row[0] * wx[0] + row[1] * wx[1] + row[2] * wx[2];
                plane += wy[j] * along;
                plane_y += gy[j] * along;
                plane_x += wy[j] * (row[0] * gx[0] + row[1] * gx[1] + row[2] * gx[2]);
            }
            value += wz[k] * plane;
            gradient += DVec3::new(wz[k] * plane_x, wz[k] * plane_y, gz[k] * plane);
        }
        (value, gradient / self.grid.spacing)
    }

    /// Second derivative at a point of the grid, 1/m of the function's unit.
    pub fn second_derivative(&self, point: DVec3) -> DMat3 {
        let ([i, first_j, first_k], offsets) = self.grid.splines_at(point);
        let [[wx, gx], [wy, gy], [wz, gz]] = offsets.map(|f| [weights(f), slopes(f)]);
        let [mut xx, mut yy, mut zz, mut xy, mut xz, mut yz] = [0.0; 6];
        for k in 0..3 {
            for j in 0..3 {
                let Some(row) = self.row([i, first_j + j, first_k + k]) else { continue };
                let row = DVec3::from_array(row);
                let [value, slope, bend] = [wx, gx, BEND].map(|x| row.dot(x.into()));
                xx += bend * wy[j] * wz[k];
                yy += value * BEND[j] * wz[k];
                zz += value * wy[j] * BEND[k];
                xy += slope * gy[j] * wz[k];
                xz += slope * wy[j] * gz[k];
                yz += value * gy[j] * gz[k];
            }
        }
        let per_cell = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        per_cell * (1.0 / (self.grid.spacing * self.grid.spacing))
    }

    /// Coefficients of a node and of the two after it along x.
    fn row(&self, first: [usize; 3]) -> Option<[f64; 3]> {
        let row = self.coefficients[self.grid.node(first)..].first_chunk::<3>()?;
        Some(row.map(f64::from))
    }
}

/// Splines of three neighbouring nodes, so many cells from the second.
fn weights(f: f64) -> [f64; 3] {
    [0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)]
}

/// Their slopes.
fn slopes(f: f64) -> [f64; 3] {
    [f - 0.5, -2.0 * f, f + 0.5]
}

/// Coefficients of the spline through given values. Along an axis the spline is `c + (c_- - 2 c + c_+)/8` at a node,
/// which is solved by sweeps of `c = value - (c_- - 2 c + c_+)/8`; the outermost nodes keep their values.
fn prefiltered(values: &[f64], nodes: [usize; 3]) -> Vec<f64> {
    let mut solved = values.to_vec();
    let strides = [1, nodes[0], nodes[0] * nodes[1]];
    for axis in 0..3 {
        let (right, stride) = (solved.clone(), strides[axis]);
        let mut next = solved.clone();
        for _ in 0..PREFILTER_SWEEPS {
            for at in 0..solved.len() {
                let place = at / stride % nodes[axis];
                if place > 0 && place + 1 < nodes[axis] {
                    // Solved for the diagonal, 3/4.
                    next[at] = (right[at] - (solved[at - stride] + solved[at + stride]) / 8.0) / 0.75;
                }
            }
            std::mem::swap(&mut solved, &mut next);
        }
    }
    solved
}
