//! Estimated error of a force beyond small strain, and the range in which the law holds.
//!
//! The parts were measured against full Newton solutions of cylinders, plates and beams (docs/accuracy.md) and are added up:
//!
//! | part | size |
//! |---|---|
//! | fit of the half-space's table | constant |
//! | elements: the compliance of the half-space that is subtracted for a patch of radius `b` | its part of the depth |
//! | narrow body: a patch of radius `b` in it is no half-space | cube of `b` over the breadth of the body |
//! | thin body that is free below: a plate bends less under a patch than under a contact | square of `b` over the thickness |
//! | half-space beyond the table's Poisson's ratios | distance from it, times `s = sqrt(d/R)` |
//! | a tool that is not a sphere, or a pad: linear there | the sphere's correction at the same mean pressure |
//! | body with a series | what the series leaves out, `|U_5| / U_2` |
//! | body without a series | square of the depth over the thickness `t` |
//! | other contacts of the body: they act linearly | their displacement over the depth |
//! | friction: it hinders the sliding of the surface under the tool | force of a tool that sticks over that of one that slides |
//!
//! A rigid punch that sticks is pushed back by `(1 - nu) ln(3 - 4 nu) / (1 - 2 nu)` times the force of a smooth one (Mossakovskii,
//! 1963; Spence, 1968).

use glam::DVec3;

use super::response::LocalResponse;
use crate::contact::local::{DEEPEST_FIT, STRAIN_RATIOS};
use crate::contact::shape::ToolShape;
use crate::math::log;
use crate::simulation::contacts::Contact;
use crate::simulation::tool::ToolModel;

/// Error of the table.
const CONSTANT: f64 = 0.01;
/// Error of the elements, over the displacement of a half-space under the same patch `0.77 F/(E* b)`, over the depth.
const BY_ELEMENTS: f64 = 0.04;
/// Factors of the cube of `b` over the breadth: for a body whose support stiffens the contact, and added to it for one that is free
/// below. They differ in the part of the depth by which the body yields, which is negative above a support.
const BY_BREADTH: [f64; 2] = [0.3, 0.45];
const SUPPORTED: f64 = -0.15;
/// Most that this part states: forces on the narrowest columns measured were 10 % off.
const MOST_BY_BREADTH: f64 = 0.14;
/// Factor of the square of `b` over the thickness, at most 1, of a body that is free below: plates that are held at their rim.
const BY_BENDING: f64 = 0.15;
/// Change of the force with Poisson's ratio over `s`.
const BY_POISSON: f64 = 0.8;
/// Error of the force under other shapes over the correction of a sphere: without a correction, and with that of an ellipsoid.
const BY_SHAPE: f64 = 1.5;
const BY_ELLIPSOID: f64 = 0.4;
/// Largest `s` of an equal mean pressure.
const DEEPEST: f64 = 1.5;
/// Factors of the other parts.
const BY_SERIES: f64 = 2.0;
const BY_DEPTH: f64 = 0.2;
const BY_OTHERS: f64 = 0.5;
/// Coefficient of friction from which a tool sticks nearly everywhere.
const STICKING: f64 = 0.3;
/// Largest depth that counts, over the radius and over the thickness.
const MOST_RADII: f64 = 2.0;
/// Error of the extrapolated half-space over the depth beyond the table, over the radius.
const BY_EXTRAPOLATION: f64 = 0.06;
const MOST_THICKNESS: f64 = 0.75;
/// Force over that at which the series ends up to which it counts: `|U_5| / U_2` of 2 %.
const SERIES_REACH: f64 = 1.26;

/// What else acts at a contact.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// One over the thickness of the body below, 1/m.
    pub inverse_thickness: f64,
    /// One over its breadth there, the distance through it along lines inclined by 60 degrees, 1/m.
    pub inverse_breadth: f64,
    /// Displacement by the other contacts and by loads, m.
    pub by_others: DVec3,
    pub by_loads: DVec3,
    /// Coefficient of friction.
    pub friction: f64,
}

/// Relative error of a force, and the share of it that is within the range of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceError {
    pub relative: f64,
    pub held: f64,
}

/// Estimates the error of a contact's force; zero for a linear material, whose surroundings are not found.
pub fn estimate(
    tool: &ToolModel,
    contact: &Contact,
    response: &LocalResponse,
    surroundings: impl FnOnce() -> Surroundings,
) -> ForceError {
    let indentation = &response.indentation;
    let material = &indentation.material;
    if material.strain_terms == [0.0; 3] || indentation.force == 0.0 {
        return ForceError { relative: 0.0, held: 1.0 };
    }
    let around = surroundings();
    let inverse_thickness = around.inverse_thickness;
    let (known, fraction) = (response.known, response.higher.fraction.max(0.0));
    // Above a support the approach of the half-space is larger than the tool's.
    let depth = if contact.depth > 0.0 { contact.depth } else { indentation.depth };
    let free = ((1.0 - indentation.depth / depth - SUPPORTED) / -SUPPORTED).clamp(0.0, 1.0);
    let parts = [
        CONSTANT,
        BY_ELEMENTS * indentation.force * material.share / (material.modulus * material.width * depth),
        ((BY_BREADTH[0] + BY_BREADTH[1] * free) * (material.width * around.inverse_breadth).powi(3))
            .min(MOST_BY_BREADTH),
        BY_BENDING * free * (material.width * inverse_thickness).min(1.0).powi(2),
        local_error(tool, response),
        known * BY_SERIES * 0.01 * fraction.powi(3),
        (1.0 - known) * BY_DEPTH * ((depth + around.by_loads.length()) * inverse_thickness).powi(2),
        BY_OTHERS * around.by_others.length() / depth * (depth / indentation.effective_radius).min(1.0),
        sticking(material.poisson) * (around.friction / STICKING).min(1.0),
    ];
    // Deeper than that the force stays what it is there.
    let most = (MOST_RADII * indentation.effective_radius).min(MOST_THICKNESS / inverse_thickness);
    let beyond = if tool.shape.needs_cells() { 0.0 } else { (indentation.depth - most).max(0.0) };
    let local = 1.0 - (indentation.stiffness * beyond / indentation.force).clamp(0.0, 1.0);
    let series = 1.0 - known * (1.0 - SERIES_REACH / fraction.max(SERIES_REACH));
    let held = local.min(series);
    // The force that is held would go on growing.
    ForceError { relative: parts.iter().sum::<f64>() + (1.0 - held), held }
}

/// Error of the half-space.
fn local_error(tool: &ToolModel, response: &LocalResponse) -> f64 {
    let indentation = &response.indentation;
    let material = &indentation.material;
    let correction = |s: f64| {
        let [first, second, third] = material.strain_terms;
        (s * (first + s * (second + s * third))).abs()
    };
    if tool.shape.needs_cells() {
        // For Hertz's sphere s = a/R = 3 F / (4 E* a^2).
        let pressure = indentation.force / (material.modulus * indentation.radius.powi(2)).max(f64::MIN_POSITIVE);
        let corrected = matches!(tool.shape, ToolShape::Ellipsoid { .. });
        let part = if corrected { BY_ELLIPSOID } else { BY_SHAPE };
        return part * correction((0.75 * pressure).min(DEEPEST));
    }
    let s = (indentation.depth / indentation.effective_radius).max(0.0).sqrt();
    let [low, high] = STRAIN_RATIOS;
    let outside = (low - material.poisson).max(material.poisson - high).max(0.0);
    let beyond = (s * s - DEEPEST_FIT).max(0.0);
    BY_POISSON * outside * s + BY_EXTRAPOLATION * beyond + (1.0 - material.share) * correction(s)
}

/// Force of a punch that sticks over that of one that slides, less one.
fn sticking(poisson: f64) -> f64 {
    let left = 1.0 - 2.0 * poisson;
    // It vanishes as the square of `left`.
    if left < 1e-3 { 0.0 } else { (1.0 - poisson) * log(left.mul_add(2.0, 1.0)) / left - 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tool_that_sticks() {
        // Spence, 1968: 1.0986 at nu = 0, 1.0286 at nu = 0.3, none for a body that keeps its volume.
        for (poisson, expected) in [(0.0, 0.0986), (0.3, 0.0286), (0.5, 0.0)] {
            assert!((sticking(poisson) - expected).abs() < 1e-4, "{poisson}");
        }
    }
}
