//! Pressures that press a half-space flat against a tool: `q >= 0`, `T q + gap >= 0`, one of both zero in every cell.
//!
//! Conjugate gradients on the cells that carry pressure, as Polonsky and Keer (A numerical method for solving rough contact
//! problems based on the multi-level multi-summation and conjugate gradient techniques, 1999), started from the pressures
//! of the tick before. They let overlapping cells join with the step of the others, after which cells may join and leave
//! for ever; here cells join by a step of their own, of the best length, once what they overlap is more than what the
//! others miss (Dostal and Schoeberl, Minimizing quadratic functions subject to bound constraints, 2005). Each step lowers the
//! energy `q.T q/2 + q.gap`.

use super::influence::{Grid, Influence, MAX_CELLS, ZERO};

/// Most products with the influence that one solution takes: a bound of its time.
pub const MAX_PRODUCTS: usize = 40;
/// Overlap or gap left under a tool, over its depth, at which the solution is accepted.
pub const TOLERANCE: f64 = 1e-6;
/// Steps towards the stiffness of a punch; they leave 1e-3 from a uniform start.
const PUNCH_STEPS: usize = 2;

/// Memory of a solution; beyond the cells in use, pressures and directions are zero.
#[derive(Clone, Debug)]
pub struct PressureScratch {
    cells: usize,
    residual: Grid,
    direction: Grid,
    image: Grid,
    /// Residual under pressure, or the solution with negative pressures set to zero; and its image.
    trial: Grid,
    trial_image: Grid,
}

/// Convergence of a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Convergence {
    /// Products with the influence taken; at most [`MAX_PRODUCTS`].
    pub products: usize,
    /// Largest overlap or gap left, m.
    pub residual: f64,
}

/// Residuals of cells with and without pressure.
struct Residuals {
    squared: f64,
    squared_overlap: f64,
    largest: f64,
}

impl PressureScratch {
    /// Zeros.
    pub fn new() -> Self {
        Self { cells: MAX_CELLS, residual: ZERO, direction: ZERO, image: ZERO, trial: ZERO, trial_image: ZERO }
    }

    /// Solves for `q` (m), starting from its values. Cells where `gap` (m) is not negative carry no pressure, for pressure raises
    /// the surface nowhere. `depth` is the largest overlap, m.
    pub fn solve(&mut self, influence: &Influence, cells: usize, gap: &Grid, depth: f64, q: &mut Grid) -> Convergence {
        if cells != self.cells {
            *self = Self { cells, ..Self::new() };
        }
        let mut convergence = Convergence { products: 1, residual: 0.0 };
        self.start(influence, cells, gap, q);
        let mut scaled_before = f64::INFINITY;
        loop {
            let residuals = self.residuals(cells, gap, q);
            convergence.residual = residuals.largest;
            // A step takes up to two.
            if residuals.largest <= TOLERANCE * depth || convergence.products + 2 > MAX_PRODUCTS {
                return convergence;
            }
            convergence.products += 1;
            if residuals.squared_overlap > residuals.squared {
                self.add_cells(influence, cells, gap, q);
                scaled_before = f64::INFINITY;
                continue;
            }
            let step = self.search(influence, cells, q, &mut scaled_before);
            if self.advance(cells, q, step) {
                continue;
            }
            convergence.products += 1;
            self.remove_cells(influence, cells, gap, q, step);
            scaled_before = f64::INFINITY;
        }
    }

    /// Scales the start to the least energy and computes its residual. A start without pressure is replaced by the root of the
    /// overlap, as under a sphere.
    fn start(&mut self, influence: &Influence, cells: usize, gap: &Grid, q: &mut Grid) {
        let has_pressure = (0..cells).any(|j| (0..cells).any(|i| gap[j][i] < 0.0 && q[j][i] > 0.0));
        for j in 0..cells {
            for i in 0..cells {
                let start = if has_pressure { q[j][i] } else { (-gap[j][i]).max(0.0).sqrt() };
                q[j][i] = if gap[j][i] < 0.0 { start } else { 0.0 };
            }
        }
        influence.product(cells, q, &mut self.image);
        let (work, energy) = (-dot(q, gap), dot(q, &self.image));
        let scale = if energy > 0.0 { work / energy } else { 0.0 };
        for j in 0..cells {
            for i in 0..cells {
                q[j][i] *= scale;
                self.residual[j][i] = scale * self.image[j][i] + gap[j][i];
            }
        }
    }

    fn residuals(&self, cells: usize, gap: &Grid, q: &Grid) -> Residuals {
        let mut residuals = Residuals { squared: 0.0, squared_overlap: 0.0, largest: 0.0 };
        for j in 0..cells {
            for i in 0..cells {
                let r = self.residual[j][i];
                if q[j][i] > 0.0 {
                    residuals.squared += r * r;
                    residuals.largest = residuals.largest.max(r.abs());
                } else if gap[j][i] < 0.0 && r < 0.0 {
                    residuals.squared_overlap += r * r;
                    residuals.largest = residuals.largest.max(-r);
                }
            }
        }
        residuals
    }

    /// Adds pressure to overlapping cells in proportion to their overlap.
    fn add_cells(&mut self, influence: &Influence, cells: usize, gap: &Grid, q: &mut Grid) {
        for j in 0..cells {
            for i in 0..cells {
                let joins = q[j][i] == 0.0 && gap[j][i] < 0.0;
                self.direction[j][i] = if joins { self.residual[j][i].min(0.0) } else { 0.0 };
            }
        }
        let step = self.step_along_direction(influence, cells);
        self.take_step(cells, q, step);
    }

    /// A step along the direction.
    fn take_step(&mut self, cells: usize, q: &mut Grid, step: f64) {
        for j in 0..cells {
            for i in 0..cells {
                q[j][i] -= step * self.direction[j][i];
                self.residual[j][i] -= step * self.image[j][i];
            }
        }
    }

    /// The next conjugate direction and the best step along it. `scaled_before` is the preconditioned square of the residual a step
    /// ago, infinite for a restart.
    fn search(&mut self, influence: &Influence, cells: usize, q: &Grid, scaled_before: &mut f64) -> f64 {
        for j in 0..cells {
            for i in 0..cells {
                self.trial[j][i] = if q[j][i] > 0.0 { self.residual[j][i] } else { 0.0 };
            }
        }
        influence.precondition(cells, &self.trial, &mut self.trial_image);
        let scaled = dot(&self.trial, &self.trial_image);
        let ratio = if scaled > 0.0 { scaled / *scaled_before } else { 0.0 };
        *scaled_before = scaled;
        for j in 0..cells {
            for i in 0..cells {
                let ahead = self.trial_image[j][i] + ratio * self.direction[j][i];
                self.direction[j][i] = if q[j][i] > 0.0 { ahead } else { 0.0 };
            }
        }
        self.step_along_direction(influence, cells)
    }

    /// Length of the step against the direction that lowers the energy most; the direction's image is in `image`.
    fn step_along_direction(&mut self, influence: &Influence, cells: usize) -> f64 {
        influence.product(cells, &self.direction, &mut self.image);
        let along = dot(&self.direction, &self.residual);
        let curvature = dot(&self.direction, &self.image);
        if curvature > 0.0 { along / curvature } else { 0.0 }
    }

    /// Takes the step if no pressure turns negative.
    fn advance(&mut self, cells: usize, q: &mut Grid, step: f64) -> bool {
        let stays = |j: usize, i: usize| q[j][i] == 0.0 || q[j][i] - step * self.direction[j][i] > 0.0;
        if !(0..cells).all(|j| (0..cells).all(|i| stays(j, i))) {
            return false;
        }
        self.take_step(cells, q, step);
        true
    }

    /// Takes a step that would make pressures negative. They are set to zero if the energy still falls; otherwise the step ends
    /// where the first of them is zero.
    fn remove_cells(&mut self, influence: &Influence, cells: usize, gap: &Grid, q: &mut Grid, step: f64) {
        let mut feasible = (step, 0, 0);
        for j in 0..cells {
            for i in 0..cells {
                let ahead = q[j][i] - step * self.direction[j][i];
                self.trial[j][i] = ahead.max(0.0);
                if ahead <= 0.0 && q[j][i] > 0.0 {
                    let until = q[j][i] / self.direction[j][i];
                    feasible = if until < feasible.0 { (until, j, i) } else { feasible };
                }
            }
        }
        influence.product(cells, &self.trial, &mut self.trial_image);
        let (mut before, mut after) = (0.0, 0.0);
        for j in 0..cells {
            for i in 0..cells {
                before += q[j][i] * (self.residual[j][i] + gap[j][i]);
                after += self.trial[j][i] * (self.trial_image[j][i] + 2.0 * gap[j][i]);
            }
        }
        let (length, row, column) = feasible;
        for j in 0..cells {
            for i in 0..cells {
                if after < before {
                    q[j][i] = self.trial[j][i];
                    self.residual[j][i] = self.trial_image[j][i] + gap[j][i];
                } else {
                    q[j][i] = (q[j][i] - length * self.direction[j][i]).max(0.0);
                    self.residual[j][i] -= length * self.image[j][i];
                }
            }
        }
        if after >= before {
            q[row][column] = 0.0;
        }
    }

    /// `q.T q` of the solution, m^2.
    pub fn energy(&self, gap: &Grid, q: &Grid) -> f64 {
        dot(q, &self.residual) - dot(q, gap)
    }

    /// `1.T^-1 1` over the cells that carry pressure: the stiffness of a flat punch that covers them, which is that of the
    /// contact (its area changes the force only to second order: pressure vanishes at its rim).
    ///
    /// A few steps from the last result `p` suffice, for `2 sum(p) - p.T p` has its maximum there. Overwrites the residual.
    pub fn punch(&mut self, influence: &Influence, cells: usize, q: &Grid, p: &mut Grid) -> f64 {
        let has_pressure = (0..cells).any(|j| (0..cells).any(|i| q[j][i] > 0.0 && p[j][i] != 0.0));
        for j in 0..cells {
            for i in 0..cells {
                p[j][i] = match (q[j][i] > 0.0, has_pressure) {
                    (true, true) => p[j][i],
                    (true, false) => 1.0,
                    (false, _) => 0.0,
                };
            }
        }
        influence.product(cells, p, &mut self.image);
        let (sum_of_p, energy) = (sum(p), dot(p, &self.image));
        if !(sum_of_p > 0.0 && energy > 0.0) {
            return 0.0;
        }
        let scale = sum_of_p / energy;
        for j in 0..cells {
            for i in 0..cells {
                p[j][i] *= scale;
                self.residual[j][i] = scale * self.image[j][i] - 1.0;
            }
        }
        let mut scaled_before = f64::INFINITY;
        for _ in 0..PUNCH_STEPS {
            let step = self.search(influence, cells, q, &mut scaled_before);
            self.take_step(cells, p, step);
        }
        // 2 sum(p) - p.(residual + 1)
        sum(p) - dot(p, &self.residual)
    }
}

/// Sum of the products of two grids, column by column in a fixed order.
pub fn dot(a: &Grid, b: &Grid) -> f64 {
    let mut sums = [0.0; MAX_CELLS];
    for (a, b) in a.iter().zip(b) {
        for i in 0..MAX_CELLS {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().sum()
}

/// Sum of all entries.
fn sum(a: &Grid) -> f64 {
    a.iter().flatten().sum()
}
