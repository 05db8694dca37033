//! Rigid motions of the supports: they move the whole body and strain nothing.
//!
//! A rigid motion `r` of the whole body solves the reference problem without any force. So the known displacements may be
//! given less `r`, and `r` added to those of the answer: forces stay the same. Where supports move almost as one, the
//! columns of the supports cancel each other in the forces, and what rounding has left in them is all that remains; less
//! the rigid motion that is next to them, little is multiplied by columns.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use glam::DVec3;

use crate::green::GreensFunction;

/// Corrections of the fit: each takes out what the regularised normal equations have left.
const CORRECTIONS: usize = 4;
/// Regularisation of the normal equations, of their largest diagonal: supports may leave some rigid motions undetermined.
const REGULARISATION: f64 = 1e-12;
/// A motion is taken out where it leaves less than this part of the supports' motion: elsewhere it gains less than a digit,
/// and may ask for the columns of all supports in place of a few.
const MAX_RIGID_REMAINDER: f64 = 0.1;
/// Rounding of a given displacement and of the rigid motion there, as a part of it; what a rigid motion strains in a matrix
/// whose entries are rounded sums over elements is as much as that of some tens of roundings.
pub const INPUT_ROUNDING: f64 = 64.0 * f64::EPSILON;
/// What rounding leaves of supports that move as one, as a part of their motion.
const RIGID_TOLERANCE: f64 = 1e-12;

/// A small rigid motion of the body.
pub struct RigidMotion {
    /// Translation of the origin, m, and rotation vector, rad.
    translation: DVec3,
    rotation: DVec3,
    origin: DVec3,
    /// Whether it is all that the supports do, but for rounding.
    pub is_exact: bool,
    /// Error of taking it out in the energy norm, sqrt(J): displacements are known to a rounding of their own size.
    pub residual: f64,
}

/// A supported dof: its row, its column, and the displacement that is given, m.
type Support = (usize, usize, f64);

/// Conditions as they are given, or less a rigid motion.
pub struct Conditions {
    /// Column and value of those that keep their type.
    pub known: Vec<(usize, f64)>,
    /// Column and value of those that change it.
    pub switched: Vec<(usize, f64)>,
    /// What was taken out.
    pub motion: Option<RigidMotion>,
}

impl Conditions {
    /// Takes the rigid motion out that is nearly all that the supports do.
    pub fn new(green: &GreensFunction, known: &[(usize, f64)], switched: &[(usize, f64)]) -> Self {
        let is_support = |column: usize| green.row_is_fixed[green.row_of_column(column)];
        let released = |column: usize| switched.iter().any(|&(other, _)| other == column);
        let Some((motion, supports)) = RigidMotion::of_supports(green, known, released) else {
            return Self { known: known.to_vec(), switched: switched.to_vec(), motion: None };
        };
        let forces = known.iter().copied().filter(|&(column, _)| !is_support(column));
        let left = supports.iter().map(|&(row, column, value)| (column, value - motion.at(green, row)));
        let known = forces.chain(left.filter(|&(_, value)| value != 0.0)).collect();
        let relative = |&(column, value): &(usize, f64)| {
            let row = green.row_of_column(column);
            (column, if green.row_is_fixed[row] { value } else { value - motion.at(green, row) })
        };
        Self { known, switched: switched.iter().map(relative).collect(), motion: Some(motion) }
    }
}

impl RigidMotion {
    /// The rigid motion next to what supports are given, if it is nearly all that they do.
    ///
    /// `known` are columns and values that keep their type, `released` the columns of supports that are taken away. `None` too
    /// where some support has no column: it stays where it is.
    fn of_supports(
        green: &GreensFunction,
        known: &[(usize, f64)],
        released: impl Fn(usize) -> bool,
    ) -> Option<(Self, Vec<Support>)> {
        if !known.iter().any(|&(column, value)| value != 0.0 && green.row_is_fixed[green.row_of_column(column)]) {
            return None;
        }
        let supports = supports(green, known, released)?;
        let weight = |row: usize| green.magnitude(row);
        let size = |values: &dyn Fn(&Support) -> f64| -> f64 {
            supports.iter().map(|s| (weight(s.0) * values(s)).powi(2)).sum::<f64>().sqrt()
        };
        let origin = supports.iter().map(|s| green.surface.positions[s.0 / 3]).sum::<DVec3>() / supports.len() as f64;
        let mut motion = Self {
            translation: DVec3::ZERO,
            rotation: DVec3::ZERO,
            origin,
            is_exact: false,
            residual: INPUT_ROUNDING * supports.iter().map(|s| (weight(s.0) * s.2).abs()).sum::<f64>(),
        };
        motion.fit(green, &supports)?;
        let (given, left) = (size(&|s| s.2), size(&|s| s.2 - motion.at(green, s.0)));
        motion.is_exact = left <= RIGID_TOLERANCE * given;
        (left <= MAX_RIGID_REMAINDER * given).then_some((motion, supports))
    }

    /// Least squares of what is left of each support, weighted by what it counts in the error of an answer.
    fn fit(&mut self, green: &GreensFunction, supports: &[Support]) -> Option<()> {
        let arms = supports.iter().map(|s| (green.surface.positions[s.0 / 3] - self.origin).length());
        let length = arms.fold(f64::MIN_POSITIVE, f64::max);
        // Displacement of a dof for unit translations, and for rotations by which the farthest support moves by one.
        let motions = |row: usize| -> [f64; 6] {
            let (arm, axis) = ((green.surface.positions[row / 3] - self.origin) / length, DVec3::AXES[row % 3]);
            let turned = arm.cross(axis);
            [axis.x, axis.y, axis.z, turned.x, turned.y, turned.z]
        };
        let mut normal = Mat::<f64>::zeros(6, 6);
        for &(row, _, _) in supports {
            let (m, square) = (motions(row), green.magnitude(row).powi(2));
            for i in 0..6 {
                for j in 0..6 {
                    normal[(i, j)] += square * m[i] * m[j];
                }
            }
        }
        let largest = (0..6).map(|i| normal[(i, i)]).fold(0.0, f64::max);
        (0..6).for_each(|i| normal[(i, i)] += REGULARISATION * largest);
        let factor = normal.llt(Side::Lower).ok()?;
        for _ in 0..CORRECTIONS {
            let mut right = Mat::<f64>::zeros(6, 1);
            for &(row, _, value) in supports {
                let (m, weighted) = (motions(row), green.magnitude(row).powi(2) * (value - self.at(green, row)));
                (0..6).for_each(|i| right[(i, 0)] += weighted * m[i]);
            }
            let found = factor.solve(&right);
            self.translation += DVec3::new(found[(0, 0)], found[(1, 0)], found[(2, 0)]);
            self.rotation += DVec3::new(found[(3, 0)], found[(4, 0)], found[(5, 0)]) / length;
        }
        (self.translation.is_finite() && self.rotation.is_finite()).then_some(())
    }

    /// Displacement of the dof of a surface row, m.
    pub fn at(&self, green: &GreensFunction, row: usize) -> f64 {
        let arm = green.surface.positions[row / 3] - self.origin;
        (self.translation + self.rotation.cross(arm))[row % 3]
    }
}

/// All supports that stay; `None` where one of them has no column.
fn supports(green: &GreensFunction, known: &[(usize, f64)], released: impl Fn(usize) -> bool) -> Option<Vec<Support>> {
    let mut given = vec![0.0; 3 * green.touch.len()];
    for &(column, value) in known {
        given[column] = value;
    }
    let mut supports = Vec::with_capacity(green.fixed_rows.len());
    for row in green.fixed_rows.iter().map(|&row| row as usize) {
        let column = 3 * green.touch.binary_search(&((row / 3) as u32)).ok()? + row % 3;
        if !released(column) {
            supports.push((row, column, given[column]));
        }
    }
    (!supports.is_empty()).then_some(supports)
}
