//! Condition number of a factorised stiffness, and the most compliant node.
//!
//! Rounding perturbs an answer by up to `eps * condition` of itself, so a large enough number means that no digit is
//! right: a part of the body moves without deforming, though round-off left every pivot positive. The number is that of
//! `S = D^-1/2 K_NN D^-1/2`, `D` the diagonal, for a Cholesky factor does not feel the scaling of the dofs (A. van der
//! Sluis, 1969): materials of different stiffness side by side do no harm, one that hangs by a much softer one does.

use crate::fem::{Supports, SymmetricCsc};
use crate::{Error, Result};

/// Largest condition number that is answered: an error of a thousandth in double precision.
pub const MOST_CONDITION: f64 = 1e13;

/// Steps of the inverse iteration: the softest direction of a body that is nearly a mechanism stands out at once.
const STEPS: usize = 4;

/// Condition number of the scaled matrix, estimated from below, and what moves most in its softest direction.
#[derive(Clone, Debug)]
pub struct Condition {
    /// Largest over smallest eigenvalue.
    pub number: f64,
    /// Dof of the whole body that moves most.
    pub softest: u32,
    /// The softest direction, unit vector of `D^1/2 u` by rank of the free dofs: large where something stiff rides on
    /// something soft.
    pub direction: Vec<f64>,
}

/// Estimates the condition of the free part of `stiffness`, `K_NN x = b` being solved in place by `solve`, by inverse
/// iteration.
pub fn condition(solve: &mut dyn FnMut(&mut [f64]), stiffness: &SymmetricCsc, supports: &Supports) -> Condition {
    let diagonal = supports.free.iter().map(|&dof| stiffness.diagonal(dof).max(f64::MIN_POSITIVE));
    let root: Vec<f64> = diagonal.map(f64::sqrt).collect();
    let mut x = start(root.len());
    let (mut growth, mut softest) = (0.0, 0);
    for _ in 0..STEPS {
        x.iter_mut().zip(&root).for_each(|(x, root)| *x *= root);
        solve(&mut x);
        softest = largest(&x);
        x.iter_mut().zip(&root).for_each(|(x, root)| *x *= root);
        growth = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        x.iter_mut().for_each(|x| *x /= growth);
    }
    let number = growth * largest_row_sum(stiffness, supports, &root);
    Condition { number, softest: supports.free[softest], direction: x }
}

/// Refuses a matrix that is singular to working precision, with the place where the body gives most.
///
/// # Errors
/// A condition number beyond [`MOST_CONDITION`].
pub fn require_regular(condition: &Condition, nodes: &[glam::DVec3]) -> Result<()> {
    if condition.number <= MOST_CONDITION {
        return Ok(());
    }
    let node = condition.softest / 3;
    let [x, y, z] = nodes[node as usize].to_array();
    Err(Error::Singular(format!(
        "rounding would spoil every digit (condition number {:.0e}): a part of the body around node {node} at ({x:.4}, \
         {y:.4}, {z:.4}) m moves almost without deforming; fix nodes of it, join it to the rest by more elements, or bring \
         materials closer together",
        condition.number
    )))
}

/// Unit vector without symmetry, the same for everyone: fractional parts of multiples of the golden ratio.
fn start(count: usize) -> Vec<f64> {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    (1..=count).map(|i| ((i as f64 * ratio).fract() - 0.5) / (count as f64).sqrt()).collect()
}

fn largest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|&i, &j| values[i].abs().total_cmp(&values[j].abs())).unwrap_or(0)
}

/// Largest sum of magnitudes in a row of `S`: no eigenvalue is larger.
fn largest_row_sum(stiffness: &SymmetricCsc, supports: &Supports, root: &[f64]) -> f64 {
    let sum = |(rank, &dof): (usize, &u32)| -> f64 {
        let entries = stiffness.column(dof as usize).filter(|&(row, _)| !supports.is_fixed(row));
        entries.map(|(row, value)| value.abs() / (root[rank] * root[supports.free_rank[row as usize] as usize])).sum()
    };
    supports.free.iter().enumerate().map(sum).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use faer::Par;

    use super::*;
    use crate::solver::Factor;

    fn of_factor(matrix: &SymmetricCsc, supports: &Supports) -> Condition {
        let factor = Factor::new(matrix, supports, Par::Seq).unwrap();
        let mut memory = factor.solve_scratch(1);
        condition(&mut |x| factor.solve_in_place(x, &mut memory), matrix, supports)
    }

    /// A chain of nodes between walls, with the same springs along each axis.
    fn chain(springs: &[f64]) -> (SymmetricCsc, Supports) {
        let count = springs.len() + 1;
        let dimension = 3 * count;
        let mut matrix = SymmetricCsc { dimension, column_start: vec![0], rows: Vec::new(), values: Vec::new() };
        for dof in 0..dimension {
            let j = dof / 3;
            let (left, right) = (if j > 0 { springs[j - 1] } else { 0.0 }, springs.get(j).copied().unwrap_or(0.0));
            for (row, value) in [(dof.wrapping_sub(3), -left), (dof, left + right), (dof + 3, -right)] {
                if row < dimension {
                    matrix.rows.push(row as u32);
                    matrix.values.push(value);
                }
            }
            matrix.column_start.push(matrix.rows.len());
        }
        let ends = (0..3).chain(dimension - 3..dimension).map(|dof| dof as u32).collect();
        let supports = Supports::new(dimension, ends).unwrap();
        (matrix, supports)
    }

    #[test]
    fn a_uniform_chain_has_the_condition_of_its_closed_form() {
        // n free dofs: eigenvalues 2 - 2 cos(k pi / (n + 1)), scaled by the diagonal 2.
        let (matrix, supports) = chain(&[3.0; 30]);
        let found = of_factor(&matrix, &supports);
        let softest = 1.0 - (std::f64::consts::PI / 30.0).cos();
        assert!((found.number * softest / 2.0 - 1.0).abs() < 0.05, "{}", found.number);
        assert!((found.softest as i32 / 3 - 15).abs() <= 2);
    }

    #[test]
    fn stiffness_by_itself_does_no_harm_but_hanging_by_a_soft_spring_does() {
        let (matrix, supports) = chain(&[1.0, 1e9, 1.0, 1.0, 1.0]);
        // A pair of dofs tied by the stiff spring hangs by the soft ones: their stiffness 1.5, their mass in S 2e9.
        let found = of_factor(&matrix, &supports);
        assert!((1e9..1e10).contains(&found.number), "{}", found.number);
        assert!((1..=2).contains(&(found.softest / 3)));
        let (matrix, supports) = chain(&[1e9, 1.0, 1.0, 1.0, 1.0]);
        assert!(of_factor(&matrix, &supports).number < 100.0);
    }
}
