//! A dense symmetric system of a few contacts.

use super::MAX_CONTACTS;

/// Most unknowns.
pub const MAX_DOFS: usize = 3 * MAX_CONTACTS;

/// Matrix and right-hand side; only their leading part is used.
pub struct System {
    /// The matrix, rows first.
    pub matrix: [[f64; MAX_DOFS]; MAX_DOFS],
    /// The right-hand side, then the solution.
    pub right: [f64; MAX_DOFS],
}

impl Default for System {
    fn default() -> Self {
        Self { matrix: [[0.0; MAX_DOFS]; MAX_DOFS], right: [0.0; MAX_DOFS] }
    }
}

impl System {
    /// Solves the leading `n` equations in place, whatever the matrix, by elimination with row pivots.
    pub fn solve_unsymmetric(&mut self, n: usize) {
        let (a, x) = (&mut self.matrix, &mut self.right);
        for k in 0..n {
            let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap_or(k);
            if pivot != k {
                // Whole rows are several times as long as what is used of them.
                for j in k..n {
                    (a[k][j], a[pivot][j]) = (a[pivot][j], a[k][j]);
                }
                x.swap(k, pivot);
            }
            for i in k + 1..n {
                let factor = a[i][k] / a[k][k];
                for j in k + 1..n {
                    a[i][j] -= factor * a[k][j];
                }
                x[i] -= factor * x[k];
            }
        }
        for k in (0..n).rev() {
            for j in k + 1..n {
                x[k] -= a[k][j] * x[j];
            }
            x[k] /= a[k][k];
        }
    }

    /// Solves the leading `n` equations in place. A pivot that is not positive yields infinities or NaN, which the safety
    /// stage turns into a latched fault; nothing here panics.
    pub fn solve(&mut self, n: usize) {
        let (a, x) = (&mut self.matrix, &mut self.right);
        for j in 0..n {
            for k in 0..j {
                for i in j..n {
                    a[i][j] -= a[i][k] * a[j][k];
                }
            }
            let pivot = a[j][j].sqrt();
            for i in j..n {
                a[i][j] /= pivot;
            }
        }
        for i in 0..n {
            for k in 0..i {
                x[i] -= a[i][k] * x[k];
            }
            x[i] /= a[i][i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] -= a[k][i] * x[k];
            }
            x[i] /= a[i][i];
        }
    }
}
