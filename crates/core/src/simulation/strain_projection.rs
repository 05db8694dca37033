//! Projection of contact displacements on the set that the strain limit admits.
//!
//! With the compliance `C` of the contacts, compliances in series included, and `f = C^-1 d`, the largest strain is a convex
//! function of the forces, so those within the limit `L` form a convex set. The tools count as displaced by
//!
//! ```text
//! p = argmin (d - p)^T C^-1 (d - p) / 2    with    strain(C^-1 p) <= L
//! ```
//!
//! The force `C^-1 p` is the gradient by `d` of `d^T C^-1 d / 2` less that minimum (Moreau): a closed path of the tools does no
//! work, beyond the limit as well. Shortening `d` alone, which needs no iteration, releases energy where a tool moves round a
//! circle. The set is approached from outside by cutting planes: half-spaces `a . f <= a . b` that support it at `b`, the share of
//! the latest forces that is within the limit; on `n` of them the minimum is `p = d - sum mu_i a_i`, `mu >= 0`, found by the active
//! set of Lawson and Hanson (1974).

use glam::DVec3;

use super::MAX_CONTACTS;

/// Most cutting planes.
const MAX_PLANES: usize = 16;
/// Most changes of the active set.
const MAX_CHANGES: usize = 4 * MAX_PLANES;
/// Part by which the diagonal of the planes' matrix is raised: more planes than components of force are linearly dependent.
const RIDGE: f64 = 1e-11;
/// A plane's inequality counts as satisfied if the violation is below this part of its distance.
const SATISFIED: f64 = 1e-12;
/// A share of the forces within this of one counts as one.
const FULL_SHARE: f64 = 1e-6;

/// One vector for each contact.
pub type Vectors = [DVec3; MAX_CONTACTS];

/// Strain limit of the contacts of a body as a convex constraint on their forces.
pub trait StrainConstraint {
    /// Forces for displacements, `C^-1 d`, N.
    fn forces(&mut self, displacements: &Vectors) -> Vectors;
    /// Largest share of forces that is within the limit.
    fn share(&self, forces: &Vectors) -> f64;
    /// Gradient of the largest strain by the forces, up to a positive factor.
    fn gradient(&self, forces: &Vectors) -> Vectors;
}

/// Half-spaces that support the set of admissible forces.
struct CuttingPlanes {
    count: usize,
    /// `a`, and `C^-1 a`.
    normals: [Vectors; MAX_PLANES],
    normal_forces: [Vectors; MAX_PLANES],
    /// `a_i C^-1 a_j`, and by how much the forces of `d` lie outside.
    matrix: [[f64; MAX_PLANES]; MAX_PLANES],
    excess: [f64; MAX_PLANES],
    multipliers: [f64; MAX_PLANES],
}

/// Admissible displacements closest to `displacements`; `None` if those are admissible.
pub fn project(contacts: &mut impl StrainConstraint, displacements: &Vectors) -> Option<Vectors> {
    let unlimited = contacts.forces(displacements);
    let radial = contacts.share(&unlimited);
    if radial >= 1.0 {
        return None;
    }
    let zero = [DVec3::ZERO; MAX_CONTACTS];
    let mut planes = CuttingPlanes {
        count: 0,
        normals: [zero; MAX_PLANES],
        normal_forces: [zero; MAX_PLANES],
        matrix: [[0.0; MAX_PLANES]; MAX_PLANES],
        excess: [0.0; MAX_PLANES],
        multipliers: [0.0; MAX_PLANES],
    };
    let (mut forces, mut share) = (unlimited, radial);
    while share < 1.0 - FULL_SHARE && planes.count < MAX_PLANES {
        let bound = forces.map(|force| share * force);
        let normal = contacts.gradient(&bound);
        let normal_forces = contacts.forces(&normal);
        if !planes.add(normal, normal_forces, &unlimited, &bound) {
            return Some(displacements.map(|d| radial * d));
        }
        forces = planes.subtract_planes(&unlimited, &planes.normal_forces);
        share = contacts.share(&forces);
    }
    Some(planes.subtract_planes(displacements, &planes.normals).map(|d| share * d))
}

impl CuttingPlanes {
    /// Adds a half-space and updates the multipliers; false if it is degenerate.
    fn add(&mut self, normal: Vectors, normal_forces: Vectors, unlimited: &Vectors, bound: &Vectors) -> bool {
        let n = self.count;
        (self.normals[n], self.normal_forces[n]) = (normal, normal_forces);
        self.excess[n] = dot(&normal, unlimited) - dot(&normal, bound);
        for i in 0..=n {
            let product = dot(&self.normals[i], &normal_forces);
            (self.matrix[i][n], self.matrix[n][i]) = (product, product);
        }
        if !(self.matrix[n][n] > 0.0 && self.matrix[n][n].is_finite() && self.excess[n].is_finite()) {
            return false;
        }
        self.count += 1;
        self.find_multipliers();
        true
    }

    /// Minimises `mu . Q mu / 2 - c . mu` over `mu >= 0`, from the multipliers as they are.
    fn find_multipliers(&mut self) {
        let n = self.count;
        let mut active = [false; MAX_PLANES];
        (0..n).for_each(|i| active[i] = self.multipliers[i] > 0.0);
        for _ in 0..MAX_CHANGES {
            let slope =
                |i: usize| self.excess[i] - (0..n).map(|j| self.matrix[i][j] * self.multipliers[j]).sum::<f64>();
            let scaled = |i: usize| slope(i) / self.matrix[i][i].sqrt();
            let steepest = (0..n).filter(|&i| !active[i]).max_by(|&i, &j| scaled(i).total_cmp(&scaled(j)));
            let Some(next) = steepest.filter(|&i| slope(i) > SATISFIED * self.excess[i].abs()) else { return };
            active[next] = true;
            // The unconstrained minimum on the active ones, or as far towards it as none turns negative.
            for _ in 0..n {
                let target = self.minimum_on(&active);
                let ratio = |i: usize| match active[i] && target[i] <= 0.0 {
                    true => self.multipliers[i] / (self.multipliers[i] - target[i]),
                    false => 1.0,
                };
                let ratios: [f64; MAX_PLANES] = std::array::from_fn(|i| if i < n { ratio(i) } else { 1.0 });
                let step = ratios.into_iter().fold(1.0, f64::min);
                for i in (0..n).filter(|&i| active[i]) {
                    self.multipliers[i] += step * (target[i] - self.multipliers[i]);
                }
                if step >= 1.0 {
                    break;
                }
                for i in (0..n).filter(|&i| ratios[i] <= step) {
                    (active[i], self.multipliers[i]) = (false, 0.0);
                }
            }
        }
    }

    /// `Q mu = c` on the active half-spaces, zero on the others.
    fn minimum_on(&self, active: &[bool; MAX_PLANES]) -> [f64; MAX_PLANES] {
        let (mut a, mut x) = (self.matrix, self.excess);
        (0..self.count).for_each(|k| a[k][k] *= 1.0 + RIDGE);
        for k in 0..self.count {
            if !active[k] {
                continue;
            }
            for i in k + 1..self.count {
                let factor = a[i][k] / a[k][k];
                for j in k + 1..self.count {
                    a[i][j] -= factor * a[k][j];
                }
                x[i] -= factor * x[k];
            }
        }
        for k in (0..self.count).rev() {
            if active[k] {
                let known: f64 = (k + 1..self.count).filter(|&j| active[j]).map(|j| a[k][j] * x[j]).sum();
                x[k] = (x[k] - known) / a[k][k];
            } else {
                x[k] = 0.0;
            }
        }
        x
    }

    /// `from - sum mu_i directions_i`.
    fn subtract_planes(&self, from: &Vectors, directions: &[Vectors; MAX_PLANES]) -> Vectors {
        let mut subtract_planes = *from;
        for (direction, multiplier) in directions[..self.count].iter().zip(self.multipliers) {
            for (value, &along) in subtract_planes.iter_mut().zip(direction) {
                *value -= multiplier * along;
            }
        }
        subtract_planes
    }
}

fn dot(a: &Vectors, b: &Vectors) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One contact, anisotropic stiffness, admissible forces in an ellipsoid `f . q f <= 1`.
    struct Ellipsoid {
        stiffness: DVec3,
        q: DVec3,
    }

    impl StrainConstraint for Ellipsoid {
        fn forces(&mut self, displacements: &Vectors) -> Vectors {
            displacements.map(|d| self.stiffness * d)
        }
        fn share(&self, forces: &Vectors) -> f64 {
            (1.0 / forces[0].dot(self.q * forces[0]).sqrt()).min(1.0)
        }
        fn gradient(&self, forces: &Vectors) -> Vectors {
            let mut gradient = [DVec3::ZERO; MAX_CONTACTS];
            gradient[0] = self.q * forces[0];
            gradient
        }
    }

    fn at(d: DVec3) -> Vectors {
        let mut all = [DVec3::ZERO; MAX_CONTACTS];
        all[0] = d;
        all
    }

    /// At the minimum `d - p` is along the outer normal by the forces, `d - p = mu grad g`, and the limit is met.
    #[test]
    fn the_closest_point_meets_the_conditions_of_a_minimum() {
        let mut body = Ellipsoid { stiffness: DVec3::new(1.0, 2.0, 0.7), q: DVec3::new(1.0, 0.3, 2.0) };
        for d in [DVec3::new(3.0, 1.0, -2.0), DVec3::new(0.1, 5.0, 0.0), DVec3::new(-9.0, 9.0, 9.0)] {
            let p = project(&mut body, &at(d)).expect("beyond the limit")[0];
            let force = body.stiffness * p;
            assert!((force.dot(body.q * force) - 1.0).abs() < 1e-4);
            let (normal, correction) = ((body.q * force).normalize(), (d - p).normalize());
            assert!(normal.dot(correction) > 1.0 - 1e-3, "{normal} {correction}");
        }
        assert!(project(&mut body, &at(DVec3::splat(0.1))).is_none());
    }

    /// Work of a tool on a circle beyond the limit: none by the projection, much by shortening the displacement alone.
    #[test]
    fn a_circle_does_no_work() {
        let mut body = Ellipsoid { stiffness: DVec3::new(1.0, 2.0, 0.7), q: DVec3::new(1.0, 0.3, 2.0) };
        let circle = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / 2000.0;
            DVec3::new(2.0 + angle.cos(), 1.5 + angle.sin(), 1.0)
        };
        let mut work = [(0.0, 0.0); 2];
        for k in 0..2000 {
            let (d, step) = (circle(k), circle(k + 1) - circle(k));
            let middle = d + step / 2.0;
            let closest = project(&mut body, &at(middle)).expect("beyond the limit")[0];
            let radial = middle * body.share(&at(body.stiffness * middle));
            for ((sum, size), p) in work.iter_mut().zip([closest, radial]) {
                let part = (body.stiffness * p).dot(step);
                (*sum, *size) = (*sum + part, *size + part.abs());
            }
        }
        assert!(work[0].0.abs() < 2e-4 * work[0].1, "{work:?}");
        assert!(work[1].0.abs() > 1e-2 * work[1].1, "{work:?}");
    }
}
