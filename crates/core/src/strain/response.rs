//! Share of the contact forces that keeps the strain within a limit, evaluated in the tick. Nothing here allocates.

use glam::DVec3;

use super::StrainKind;

/// Most places at which a limit is watched in a tick.
pub const MAX_STRAIN_PLACES: usize = 32;
/// Most contacts whose strain is superposed.
pub const MAX_CONTACTS_WATCHED: usize = 4;

/// Strain is held this part of the limit below it, found to the same accuracy in at most so many steps.
pub(super) const MARGIN: f64 = 1e-3;
const STEPS: usize = 20;
/// Strains above this are not computed with: their cubes still are finite numbers.
const LARGEST_SAMPLE: f64 = 1e60;

/// What a strain follows from at one place: affine in the forces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Under the body's own loads.
    pub base: [f64; 6],
    /// Per newton on each contact's patch along x, y, z.
    pub slope: [[[f64; 6]; 3]; MAX_CONTACTS_WATCHED],
}

impl Place {
    /// Change under the forces of the first `contacts` contacts.
    #[inline]
    pub fn step(&self, forces: &[DVec3], contacts: usize) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for (slope, force) in self.slope[..contacts].iter().zip(forces) {
            for k in 0..6 {
                sum[k] += force.x * slope[0][k] + force.y * slope[1][k] + force.z * slope[2][k];
            }
        }
        sum
    }
}

/// Strain at the places that matter for the contacts it was prepared for, per unit force on their patches.
///
/// Forces are those at the Green's function's own stiffness: of a body whose stiffness is scaled, divided by the scale.
#[derive(Clone, Debug)]
pub struct StrainResponse {
    kind: StrainKind,
    contacts: usize,
    count: usize,
    /// Largest strain of the places under the body's own loads.
    at_rest: f64,
    places: [Place; MAX_STRAIN_PLACES],
}

impl StrainResponse {
    /// At most [`MAX_STRAIN_PLACES`] of `places`, the first ones, for the first `contacts` contacts.
    #[cfg(any(test, feature = "strain"))]
    pub(super) fn new(kind: StrainKind, contacts: usize, places: &[Place]) -> Self {
        let empty = Place { base: [0.0; 6], slope: [[[0.0; 6]; 3]; MAX_CONTACTS_WATCHED] };
        let mut response = Self {
            kind,
            contacts: contacts.min(MAX_CONTACTS_WATCHED),
            count: places.len().min(MAX_STRAIN_PLACES),
            at_rest: 0.0,
            places: [empty; MAX_STRAIN_PLACES],
        };
        response.places[..response.count].copy_from_slice(&places[..response.count]);
        response.at_rest =
            response.places[..response.count].iter().map(|p| kind.magnitude(&p.base)).fold(0.0, f64::max);
        response
    }

    /// Number of contacts it was prepared for; forces of others count nothing.
    pub fn contacts(&self) -> usize {
        self.contacts
    }

    /// Number of places that are watched.
    pub fn place_count(&self) -> usize {
        self.count
    }

    /// Largest strain at the places under forces (N) on the patches.
    pub fn largest(&self, forces: &[DVec3; MAX_CONTACTS_WATCHED]) -> f64 {
        self.largest_at(1.0, &self.steps(forces))
    }

    /// Largest share `s` in [0, 1] of the forces (N) on the patches for which no place passes `limit`; zero if they are not
    /// numbers.
    ///
    /// Strain ends within two margins (0.1 % of the limit each) below the limit.
    pub fn share(&self, forces: &[DVec3; MAX_CONTACTS_WATCHED], limit: f64) -> f64 {
        let steps = self.steps(forces);
        largest_share(self.at_rest, limit, |share| self.largest_at(share, &steps))
    }

    /// Gradient of the largest strain by the forces, 1/N, at the place that is strained most under them.
    pub fn gradient(&self, forces: &[DVec3; MAX_CONTACTS_WATCHED]) -> [DVec3; MAX_CONTACTS_WATCHED] {
        let steps = self.steps(forces);
        let strain =
            |place: &Place, step: &[f64; 6]| self.kind.magnitude(&std::array::from_fn(|k| place.base[k] + step[k]));
        let strains = self.places[..self.count].iter().zip(&steps).map(|(place, step)| strain(place, step));
        let most = strains.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let mut gradient = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
        let Some((most, _)) = most else { return gradient };
        let (place, step) = (&self.places[most], &steps[most]);
        // Central differences: a principal value is smooth but where two of them meet.
        let size = 1e-5 * forces.iter().map(|force| force.length()).fold(0.0, f64::max);
        for (slopes, gradient) in place.slope[..self.contacts].iter().zip(&mut gradient) {
            for (axis, slope) in slopes.iter().enumerate() {
                let at = |change: f64| strain(place, &std::array::from_fn(|k| step[k] + change * slope[k]));
                gradient[axis] = (at(size) - at(-size)) / (2.0 * size);
            }
        }
        gradient
    }

    /// Change of every place under the whole forces. NaN where a force is not finite.
    fn steps(&self, forces: &[DVec3; MAX_CONTACTS_WATCHED]) -> [[f64; 6]; MAX_STRAIN_PLACES] {
        let mut steps = [[0.0; 6]; MAX_STRAIN_PLACES];
        for (step, place) in steps[..self.count].iter_mut().zip(&self.places) {
            *step = place.step(forces, self.contacts);
        }
        steps
    }

    /// Largest strain of the places at a share of the steps; infinite if it is not a number.
    fn largest_at(&self, share: f64, steps: &[[f64; 6]; MAX_STRAIN_PLACES]) -> f64 {
        let mut largest = 0.0;
        for (place, step) in self.places[..self.count].iter().zip(steps) {
            let sample = std::array::from_fn(|k| place.base[k] + share * step[k]);
            // Beyond, and where it is not a number, cubes overflow.
            if !sample.iter().all(|x: &f64| x.abs() < LARGEST_SAMPLE) {
                return f64::INFINITY;
            }
            largest = self.kind.magnitude_above(&sample, largest);
        }
        largest
    }
}

/// Largest share in [0, 1] for which `largest_at(share)` does not pass `limit`, being `at_rest` at zero.
///
/// The excess over the limit goes to zero by chords, in a single one where the body has no loads: infinitesimal strain is
/// then proportional to the share. The end that stays is given half its excess (the Illinois rule), for the largest
/// principal value is convex in the share, and the in-plane Green strain quadratic.
pub(super) fn largest_share(at_rest: f64, limit: f64, largest_at: impl Fn(f64) -> f64) -> f64 {
    let margin = MARGIN * limit;
    let excess = |share: f64| largest_at(share) - limit + margin;
    let (mut low, mut low_excess) = (0.0, at_rest - limit + margin);
    let (mut high, mut high_excess) = (1.0, excess(1.0));
    if high_excess <= margin {
        return 1.0;
    }
    if !high_excess.is_finite() || low_excess >= 0.0 {
        return 0.0;
    }
    for _ in 0..STEPS {
        let share = low - (high - low) * low_excess / (high_excess - low_excess);
        let found = excess(share);
        if found.abs() <= margin {
            return share;
        }
        if found < 0.0 {
            (low, low_excess, high_excess) = (share, found, 0.5 * high_excess);
        } else {
            (high, high_excess, low_excess) = (share, found, 0.5 * low_excess);
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place that a force along x stretches by `slope` per newton, on a body that its loads stretch by `base`.
    fn stretched(base: f64, slope: f64) -> StrainResponse {
        let mut place = Place { base: [base, 0.0, 0.0, 0.0, 0.0, 0.0], slope: [[[0.0; 6]; 3]; MAX_CONTACTS_WATCHED] };
        place.slope[1][0][0] = slope;
        StrainResponse::new(StrainKind::Infinitesimal, 2, &[place])
    }

    fn along_x(force: f64) -> [DVec3; MAX_CONTACTS_WATCHED] {
        [DVec3::NAN, DVec3::X * force, DVec3::ZERO, DVec3::ZERO]
    }

    #[test]
    fn the_share_is_what_is_left_of_the_limit() {
        for (base, slope, force, share) in
            [(0.0, 0.02, 10.0, 0.5), (0.05, 0.02, 10.0, 0.25), (-0.05, 0.02, 10.0, 0.75), (0.0, 0.02, 1.0, 1.0)]
        {
            let response = stretched(base, slope);
            let mut forces = along_x(force);
            forces[0] = DVec3::ZERO;
            let found = response.share(&forces, 0.1);
            assert!(found <= share && found > share - 2.1 * MARGIN * 0.1 / (slope * force), "{base}: {found}");
        }
    }

    #[test]
    fn nothing_of_a_force_that_is_no_number_passes() {
        let response = stretched(0.0, 0.02);
        assert_eq!(response.share(&along_x(1.0), 0.1), 0.0);
        let mut forces = along_x(f64::INFINITY);
        forces[0] = DVec3::ZERO;
        assert_eq!(response.share(&forces, 0.1), 0.0);
        forces[1] = DVec3::X * 1e200;
        assert_eq!(response.share(&forces, 0.1), 0.0);
    }

    /// Squared stretch: `E = ((1 + s f)^2 - 1) / 2` is at the limit for `f = (sqrt(1 + 2 limit) - 1) / s`.
    #[test]
    fn in_plane_strain_is_followed_round_its_bend() {
        let mut place = Place { base: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0], slope: [[[0.0; 6]; 3]; MAX_CONTACTS_WATCHED] };
        place.slope[0][0][0] = 0.05;
        let response = StrainResponse::new(StrainKind::InPlane, 1, &[place]);
        let expected = (1.2_f64.sqrt() - 1.0) / 0.05;
        for force in [3.0, 30.0, 3000.0] {
            let share = response.share(&[DVec3::X * force, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO], 0.1);
            assert!(share * force <= expected && share * force > 0.997 * expected, "{}", share * force);
        }
    }
}
