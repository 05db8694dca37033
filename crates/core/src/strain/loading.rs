//! Sampled directions of contact forces, which represent all loadings of one contact or several.

use glam::DVec3;

use super::response::MAX_CONTACTS_WATCHED;
use crate::math::{cos, pow, sin};

/// Directions on half a sphere for a single contact; twice as many combinations for each further one.
const DIRECTIONS: usize = 200;

/// Forces on the patches of up to four contacts, of components up to one.
pub type Loading = [DVec3; MAX_CONTACTS_WATCHED];

/// Directions of each contact alone, evenly on half a sphere (Fibonacci's lattice), then combinations: the points of a
/// Kronecker sequence (powers of the root of `x^(d+1) = x + 1`; Roberts, 2018), which fill the cube evenly.
pub fn loadings(contacts: usize) -> Vec<Loading> {
    let mut directions = Vec::new();
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    for contact in 0..contacts {
        directions.extend((0..DIRECTIONS).map(|k| {
            let z = (k as f64 + 0.5) / DIRECTIONS as f64;
            let (radius, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
            let mut loading = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
            loading[contact] = DVec3::new(radius * cos(angle), radius * sin(angle), z);
            loading
        }));
    }
    if contacts > 1 {
        let dimension = 3 * contacts;
        let mut root = 1.5_f64;
        for _ in 0..40 {
            root = pow(1.0 + root, 1.0 / (dimension as f64 + 1.0));
        }
        directions.extend((1..=2 * DIRECTIONS * (contacts - 1)).map(|k| {
            let coordinate = |axis: usize| 2.0 * (k as f64 * root.powi(-(axis as i32 + 1))).fract() - 1.0;
            let vector = |c: usize| DVec3::from_array(std::array::from_fn(|axis| coordinate(3 * c + axis)));
            std::array::from_fn(|c| if c < contacts { vector(c) } else { DVec3::ZERO })
        }));
    }
    directions
}
