//! Pressures that press a half-space flat against a tool: `q >= 0`, `T q + gap >= 0`, one of both zero in every cell.
//!
//! Conjugate gradients on the cells that carry pressure (Polonsky and Keer, A numerical method for solving rough contact
//! problems based on the multi-level multi-summation and conjugate gradient techniques, 1999), started from the pressures
//! of the tick before. Cells whose pressure would be negative leave, cells that would overlap join, and then the
//! directions start anew.

use super::influence::{Grid, Influence, MAX_CELLS};

/// Most iterations of one solution.
pub const MAX_ITERATIONS: usize = 40;
/// Overlap or gap left under a tool, over its depth, at which the solution is accepted.
pub const TOLERANCE: f64 = 1e-7;

/// Steps towards the stiffness of a punch; two leave 1 % from a uniform start.
const PUNCH_STEPS: usize = 3;

/// Memory of a solution.
#[derive(Clone, Debug)]
pub struct PressureScratch {
    residual: Grid,
    direction: Grid,
    image: Grid,
}

/// How a solution ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Convergence {
    /// Iterations taken; at most [`MAX_ITERATIONS`].
    pub iterations: usize,
    /// Products with the influence taken.
    pub products: usize,
    /// Largest overlap or gap left, m.
    pub miss: f64,
}

impl PressureScratch {
    /// Zeros.
    pub fn new() -> Self {
        let zero = [[0.0; MAX_CELLS]; MAX_CELLS];
        Self { residual: zero, direction: zero, image: zero }
    }

    /// Solves for `q` (m), whose values are where to start. Nothing is carried where `gap` (m) is not negative: the surface
    /// under pressure is nowhere raised. `depth` is the largest overlap, m.
    pub fn solve(&mut self, influence: &Influence, cells: usize, gap: &Grid, depth: f64, q: &mut Grid) -> Convergence {
        let mut told = Convergence { products: 1, ..Default::default() };
        self.start(influence, cells, gap, q);
        let mut squared_before = f64::INFINITY;
        while told.iterations < MAX_ITERATIONS {
            let (squared, miss) = self.miss(cells, gap, q);
            told.miss = miss;
            if miss <= TOLERANCE * depth {
                break;
            }
            told.iterations += 1;
            told.products += 1;
            let step = self.search(influence, cells, q, squared / squared_before);
            squared_before = squared;
            if self.advance(cells, gap, q, step) {
                told.products += 1;
                self.renew(influence, cells, gap, q);
                squared_before = f64::INFINITY;
            }
        }
        told
    }

    /// Scales the start so that the energy is least, and finds its residual. A start without pressure is replaced by one
    /// like the root of the overlap, as under a sphere.
    fn start(&mut self, influence: &Influence, cells: usize, gap: &Grid, q: &mut Grid) {
        let carries = (0..cells).any(|j| (0..cells).any(|i| gap[j][i] < 0.0 && q[j][i] > 0.0));
        for j in 0..cells {
            for i in 0..cells {
                let start = if carries { q[j][i] } else { (-gap[j][i]).max(0.0).sqrt() };
                q[j][i] = if gap[j][i] < 0.0 { start } else { 0.0 };
            }
        }
        influence.product(cells, q, &mut self.image);
        let (mut work, mut energy) = (0.0, 0.0);
        for j in 0..cells {
            for i in 0..cells {
                if q[j][i] > 0.0 {
                    work -= q[j][i] * gap[j][i];
                    energy += q[j][i] * self.image[j][i];
                }
            }
        }
        let scale = if energy > 0.0 { work / energy } else { 0.0 };
        for j in 0..cells {
            for i in 0..cells {
                q[j][i] *= scale;
                self.residual[j][i] = scale * self.image[j][i] + gap[j][i];
            }
        }
    }

    /// Sum of the squared residuals under pressure, and the largest violation.
    fn miss(&self, cells: usize, gap: &Grid, q: &Grid) -> (f64, f64) {
        let (mut squared, mut miss) = (0.0, 0.0f64);
        for j in 0..cells {
            for i in 0..cells {
                let r = self.residual[j][i];
                if q[j][i] > 0.0 {
                    squared += r * r;
                    miss = miss.max(r.abs());
                } else if gap[j][i] < 0.0 {
                    miss = miss.max(-r);
                }
            }
        }
        (squared, miss)
    }

    /// The next direction and the length of the step along it; the direction's image is in `image`.
    fn search(&mut self, influence: &Influence, cells: usize, q: &Grid, ratio: f64) -> f64 {
        for j in 0..cells {
            for i in 0..cells {
                let ahead = self.residual[j][i] + ratio * self.direction[j][i];
                self.direction[j][i] = if q[j][i] > 0.0 { ahead } else { 0.0 };
            }
        }
        influence.product(cells, &self.direction, &mut self.image);
        let (mut along, mut curvature) = (0.0, 0.0);
        for j in 0..cells {
            for i in 0..cells {
                along += self.residual[j][i] * self.direction[j][i];
                curvature += self.image[j][i] * self.direction[j][i];
            }
        }
        if curvature > 0.0 { along / curvature } else { 0.0 }
    }

    /// Takes the step; true if cells left or joined, after which the residual is stale.
    fn advance(&mut self, cells: usize, gap: &Grid, q: &mut Grid, step: f64) -> bool {
        let mut changed = false;
        for j in 0..cells {
            for i in 0..cells {
                self.residual[j][i] -= step * self.image[j][i];
                let r = self.residual[j][i];
                if q[j][i] > 0.0 {
                    q[j][i] -= step * self.direction[j][i];
                    if q[j][i] <= 0.0 {
                        q[j][i] = 0.0;
                        changed = true;
                    }
                } else if gap[j][i] < 0.0 && r < 0.0 {
                    q[j][i] = -step * r;
                    changed = true;
                }
            }
        }
        changed
    }

    fn renew(&mut self, influence: &Influence, cells: usize, gap: &Grid, q: &Grid) {
        influence.product(cells, q, &mut self.image);
        for j in 0..cells {
            for i in 0..cells {
                self.residual[j][i] = self.image[j][i] + gap[j][i];
            }
        }
    }

    /// Displacement energy `q.T q`, m^2, of the solution.
    pub fn energy(&self, cells: usize, gap: &Grid, q: &Grid) -> f64 {
        let mut energy = 0.0;
        for j in 0..cells {
            for i in 0..cells {
                energy += q[j][i] * (self.residual[j][i] - gap[j][i]);
            }
        }
        energy
    }

    /// `1.T^-1 1` over the cells that carry pressure: the stiffness of a flat punch that covers them, which is that of the
    /// contact (its area changes the force only to second order: pressure vanishes at its rim).
    ///
    /// A few steps from the last answer `p` suffice, for `2 sum(p) - p.T p` has its maximum there. Forgets the residual.
    pub fn punch(&mut self, influence: &Influence, cells: usize, q: &Grid, p: &mut Grid) -> f64 {
        let carries = (0..cells).any(|j| (0..cells).any(|i| q[j][i] > 0.0 && p[j][i] != 0.0));
        for j in 0..cells {
            for i in 0..cells {
                p[j][i] = match (q[j][i] > 0.0, carries) {
                    (true, true) => p[j][i],
                    (true, false) => 1.0,
                    (false, _) => 0.0,
                };
            }
        }
        influence.product(cells, p, &mut self.image);
        let (sum, energy) = (total(cells, p, None), total(cells, p, Some(&self.image)));
        if !(sum > 0.0 && energy > 0.0) {
            return 0.0;
        }
        let scale = sum / energy;
        for j in 0..cells {
            for i in 0..cells {
                p[j][i] *= scale;
                self.residual[j][i] = scale * self.image[j][i] - 1.0;
            }
        }
        let mut squared_before = f64::INFINITY;
        for _ in 0..PUNCH_STEPS {
            let mut squared = 0.0;
            for j in 0..cells {
                for i in 0..cells {
                    squared += if q[j][i] > 0.0 { self.residual[j][i] * self.residual[j][i] } else { 0.0 };
                }
            }
            if squared <= 1e-16 {
                break;
            }
            let step = self.search(influence, cells, q, squared / squared_before);
            squared_before = squared;
            for j in 0..cells {
                for i in 0..cells {
                    p[j][i] -= step * self.direction[j][i];
                    self.residual[j][i] -= step * self.image[j][i];
                }
            }
        }
        // 2 sum(p) - p.(residual + 1)
        total(cells, p, None) - total(cells, p, Some(&self.residual))
    }
}

/// Sum of the products of two grids, or of the first one's entries.
fn total(cells: usize, a: &Grid, b: Option<&Grid>) -> f64 {
    let mut sum = 0.0;
    for j in 0..cells {
        for i in 0..cells {
            sum += if a[j][i] == 0.0 { 0.0 } else { a[j][i] * b.map_or(1.0, |b| b[j][i]) };
        }
    }
    sum
}
