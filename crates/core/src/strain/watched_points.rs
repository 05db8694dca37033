//! Choice of the watched points: the few whose strain limits a contact.
//!
//! For a loading `d` (a direction of the forces) let `t(d)` be the factor at which the first place reaches the limit. A
//! place matters if for some `d` it is that first one. The choice is greedy: the loading of which the places chosen so
//! far know least of the strain at `t(d)` adds the place that decides it, until all loadings are known to [`COVERAGE`].
//! Before, places are left out that cannot come near the limit under any of the loadings, by a bound of their strain
//! that costs no direction.

use rayon::prelude::*;

use super::StrainKind;
use super::loading::Loading;
use super::response::{MARGIN, MAX_CONTACTS_WATCHED, MAX_STRAIN_PLACES, Place, StrainResponse, largest_share};
use super::tensor::tensor_product;

/// Part of the largest strain that the chosen places show under every loading that was sampled.
const COVERAGE: f64 = 0.998;
/// Places that reach less than this part of the limit are of no interest.
const NEAR: f64 = 0.98;

/// What is known of a place without a direction.
struct Candidate {
    place: usize,
    /// Strain under the body's own loads.
    base: f64,
    /// Most change of strain per newton on each contact, to first order, and the root of what is beyond.
    slope: [f64; MAX_CONTACTS_WATCHED],
    curvature: [f64; MAX_CONTACTS_WATCHED],
}

impl Candidate {
    /// Upper bound of the strain under forces of these norms.
    fn bound(&self, forces: &[f64; MAX_CONTACTS_WATCHED]) -> f64 {
        let sum =
            |per_newton: &[f64; MAX_CONTACTS_WATCHED]| per_newton.iter().zip(forces).map(|(x, f)| x * f).sum::<f64>();
        self.base + sum(&self.slope) + 0.5 * sum(&self.curvature).powi(2)
    }
}

/// At most [`MAX_STRAIN_PLACES`] of the places; none if none counts or none is strained.
pub fn choose(
    kind: StrainKind,
    contacts: usize,
    places: &[Place],
    directions: &[Loading],
    both_signs: bool,
    limit: f64,
) -> Vec<Place> {
    let mut candidates = candidates(kind, contacts, places, limit);
    let Some(unit) = unit_forces(contacts, &candidates, limit) else { return Vec::new() };
    let signs: &[f64] = if both_signs { &[1.0, -1.0] } else { &[1.0] };
    let scaled = |loading: &Loading, sign: f64| std::array::from_fn(|c| sign * unit[c] * loading[c]);
    let forces: Vec<Loading> = signs.iter().flat_map(|&sign| directions.iter().map(move |d| scaled(d, sign))).collect();

    // The places that are strained most per newton bound the forces from above, and forces bound what else matters.
    let first: Vec<Place> = candidates.iter().take(MAX_STRAIN_PLACES).map(|c| places[c.place]).collect();
    let rough = StrainResponse::new(kind, contacts, &first);
    let factors: Vec<f64> = forces.par_iter().map(|f| factor(&rough, f, limit)).collect();
    let mut most = [0.0f64; MAX_CONTACTS_WATCHED];
    for (force, factor) in forces.iter().zip(&factors) {
        (0..contacts).for_each(|c| most[c] = most[c].max(factor * force[c].length()));
    }
    candidates.retain(|candidate| candidate.bound(&most) >= NEAR * limit);
    let near: Vec<(Candidate, Place)> = candidates.into_iter().map(|c| with_place(places, c)).collect();
    let critical: Vec<(Loading, usize)> = forces
        .par_iter()
        .zip(&factors)
        .filter_map(|(force, &factor)| first_to_reach(kind, contacts, &near, force, factor, limit))
        .collect();
    greedy(kind, contacts, &near, &critical, limit)
}

fn with_place(places: &[Place], candidate: Candidate) -> (Candidate, Place) {
    let place = places[candidate.place];
    (candidate, place)
}

/// Places that count, the ones strained most per newton first.
fn candidates(kind: StrainKind, contacts: usize, places: &[Place], limit: f64) -> Vec<Candidate> {
    let room = |base: f64| limit * (1.0 - MARGIN) - base;
    let mut candidates: Vec<(f64, Candidate)> = places
        .par_iter()
        .enumerate()
        .filter_map(|(place, p)| {
            let base = kind.magnitude(&p.base);
            let of_each = |bound: fn(StrainKind, &Place, usize) -> f64| {
                std::array::from_fn(|c| if c < contacts { bound(kind, p, c) } else { 0.0 })
            };
            let (slope, curvature) = (of_each(largest_slope), of_each(largest_curvature));
            let steepest = slope.iter().fold(0.0, |m: f64, &s| m.max(s));
            let counts = room(base) > 0.0 && steepest > 0.0;
            counts.then(|| (steepest / room(base), Candidate { place, base, slope, curvature }))
        })
        .collect();
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.place.cmp(&b.1.place)));
    candidates.into_iter().map(|(_, candidate)| candidate).collect()
}

/// Bound of the change of strain, to first order, for a force of one newton in any direction: the root of the largest
/// eigenvalue of the Gram matrix of the slopes, which is not above its largest row sum.
fn largest_slope(kind: StrainKind, place: &Place, contact: usize) -> f64 {
    let slope = place.slope[contact].map(|change| kind.linearised(&place.base, &change));
    let row = |i: usize| (0..3).map(|j| tensor_product(&slope[i], &slope[j]).abs()).sum::<f64>();
    row(0).max(row(1)).max(row(2)).sqrt()
}

/// The same of the root of what is beyond first order.
fn largest_curvature(kind: StrainKind, place: &Place, contact: usize) -> f64 {
    place.slope[contact].iter().map(|change| kind.squared_curvature(change)).sum::<f64>().sqrt()
}

/// A force on each contact, N, that strains its own places about to the limit, so that combinations are of like parts.
fn unit_forces(contacts: usize, candidates: &[Candidate], limit: f64) -> Option<[f64; MAX_CONTACTS_WATCHED]> {
    let mut unit = [0.0; MAX_CONTACTS_WATCHED];
    for (c, unit) in unit[..contacts].iter_mut().enumerate() {
        let steepest = candidates.iter().fold(0.0, |m: f64, candidate| m.max(candidate.slope[c]));
        *unit = if steepest > 0.0 { limit / steepest } else { 0.0 };
    }
    unit.iter().any(|&u| u > 0.0).then_some(unit)
}

/// Factor of the forces at which a response reaches the limit, or a thousand if it does not before.
fn factor(response: &StrainResponse, forces: &Loading, limit: f64) -> f64 {
    const FAR: f64 = 1e3;
    let mut reach = 4.0;
    while reach < FAR {
        let share = response.share(&forces.map(|f| reach * f), limit);
        if share < 1.0 {
            return reach * share;
        }
        reach *= 4.0;
    }
    FAR
}

/// The forces at which the first of the places reaches the limit, and which one it is; that is at about `factor` or
/// before. None if none of them reaches it.
fn first_to_reach(
    kind: StrainKind,
    contacts: usize,
    places: &[(Candidate, Place)],
    forces: &Loading,
    factor: f64,
    limit: f64,
) -> Option<(Loading, usize)> {
    let mut factor = 1.01 * factor;
    let mut first = None;
    // A place that passes the limit takes over at a smaller factor: few do, for the steepest come first.
    for (at, (candidate, place)) in places.iter().enumerate() {
        if candidate.bound(&forces.map(|f| factor * f.length())) <= limit {
            continue;
        }
        let step = place.step(forces, contacts);
        let largest_at = |share: f64| {
            let sample = std::array::from_fn(|k| place.base[k] + share * factor * step[k]);
            kind.magnitude_above(&sample, 0.0)
        };
        let sample = std::array::from_fn(|k| place.base[k] + factor * step[k]);
        if kind.magnitude_above(&sample, limit) > limit {
            factor *= largest_share(kind.magnitude(&place.base), limit, largest_at);
            first = Some(at);
        }
    }
    first.map(|at| (forces.map(|f| factor * f), at))
}

/// Adds the places of the worst known loadings until all are known well.
fn greedy(
    kind: StrainKind,
    contacts: usize,
    places: &[(Candidate, Place)],
    critical: &[(Loading, usize)],
    limit: f64,
) -> Vec<Place> {
    let mut chosen: Vec<usize> = Vec::with_capacity(MAX_STRAIN_PLACES);
    let mut shown = vec![0.0f64; critical.len()];
    while chosen.len() < MAX_STRAIN_PLACES {
        let worst = shown.iter().zip(critical).min_by(|a, b| a.0.total_cmp(b.0));
        let Some((&least, &(_, next))) = worst else { break };
        if least >= COVERAGE * limit * (1.0 - 2.0 * MARGIN) || chosen.contains(&next) {
            break;
        }
        chosen.push(next);
        let place = &places[next].1;
        for (shown, (forces, _)) in shown.iter_mut().zip(critical) {
            let step = place.step(forces, contacts);
            let sample: [f64; 6] = std::array::from_fn(|k| place.base[k] + step[k]);
            *shown = kind.magnitude_above(&sample, *shown);
        }
    }
    chosen.into_iter().map(|at| places[at].1).collect()
}
