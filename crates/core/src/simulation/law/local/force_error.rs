//! Estimated error of a force beyond small strain, and the range in which the law holds.
//!
//! The parts were measured against full Newton solutions of cylinders, plates and beams (docs/accuracy.md) and are added up:
//!
//! | part | size |
//! |---|---|
//! | fit of the half-space's table | constant |
//! | elements: the compliance of the half-space that is subtracted for a patch of radius `b` | its part of the depth |
//! | narrow body: a patch of radius `b` reaches its sides | sixth power of `b` over the breadth, less in a thin body |
//! | thin body on a support, pressed deep: it is squeezed out from below the contact | `b/t` times the depth over the thickness `t` |
//! | thin body that is free below: a plate bends less under a patch than under a contact, and its elements bend less | `b/t` |
//! | material that stiffens: the series leaves out its higher orders | the sphere's correction, times `b` over thickness or breadth |
//! | half-space beyond the table's Poisson's ratios | distance from it, times `s = sqrt(d/R)` |
//! | a tool that is not a sphere, or a pad: linear there | the sphere's correction at the same mean pressure |
//! | body with a series | what the series leaves out, `|U_5| / U_2` |
//! | body without a series | square of the depth over the thickness `t` |
//! | other contacts of the body: they act linearly | their displacement over the depth |
//! | contact that stays on its plane, where none of the surface is the closest (`foot_jumps`) | constant |
//! | friction: it hinders the sliding of the surface under the tool | force of a tool that sticks over that of one that slides |
//!
//! A rigid punch that sticks is pushed back by `(1 - nu) ln(3 - 4 nu) / (1 - 2 nu)` times the force of a smooth one (Mossakovskii,
//! 1963; Spence, 1968).

use super::half_space::LocalMaterial;
use super::response::LocalResponse;
use super::surroundings::Surroundings;
use crate::contact::local::{DEEPEST_FIT, STRAIN_RATIOS};
use crate::contact::shape::ToolShape;
use crate::math::log;
use crate::simulation::contacts::Contact;
use crate::simulation::tool::ToolModel;

/// Error of the table.
const CONSTANT: f64 = 0.01;
/// Error of the elements over `F/(E* b)`, over the depth: a third of what 10-node elements lack (`contact::regular`), and that of
/// 4-node elements, from whose compliance nothing is taken off.
const BY_ELEMENTS: f64 = 0.02;
const BY_LINEAR_ELEMENTS: f64 = 0.04;
/// Factors of `b` over the breadth: of its cube for a body whose support stiffens the contact, of its sixth power for one that is free
/// below, and the most that the latter counts. They differ in the part of the depth by which the body yields, which is negative above
/// a support. Forces on the narrowest columns measured, five elements wide, were 19 % off.
const BY_BREADTH: [f64; 2] = [0.17, 3.0];
const MOST_BREADTH: f64 = 0.08;
const SUPPORTED: f64 = -0.15;
/// Error of a plate that is held at its rim, the part of it that goes with `1/(1 - 2 nu)`, and the largest of these that counts. A body
/// becomes a plate between these `b/t`; from `b = t` on, where one or two elements fill its thickness, it grows as `(b/t)^1.5`.
const BY_BENDING: [f64; 2] = [0.075, 0.001];
const MOST_INCOMPRESSIBLE: f64 = 50.0;
const PLATE: [f64; 2] = [0.3, 0.7];
/// Factor of `b/t`, at most 1, times the depth over the thickness of a body on a support.
const BY_SQUEEZING: f64 = 0.12;
/// Error over the correction of a sphere of a material that stiffens.
const BY_STIFFENING: f64 = 0.55;
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
/// Error of a contact on its plane: in the hollow of a kidney the force was 16 to 25 % too large.
const ON_PLANE: f64 = 0.25;
/// Coefficient of friction from which a tool sticks nearly everywhere.
const STICKING: f64 = 0.3;
/// Largest depth that counts, over the radius and over the thickness.
const MOST_RADII: f64 = 2.0;
/// Error of the extrapolated half-space over the depth beyond the table, over the radius.
const BY_EXTRAPOLATION: f64 = 0.06;
const MOST_THICKNESS: f64 = 0.75;
/// Force over that at which the series ends up to which it counts: `|U_5| / U_2` of 2 %.
const SERIES_REACH: f64 = 1.26;

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
    let radius = tool.shape.thickness();
    let (known, fraction) = (response.known, response.higher.fraction.max(0.0));
    // Above a support the approach of the half-space is larger than the tool's.
    let depth = if contact.depth > 0.0 { contact.depth } else { indentation.depth };
    let by_elements = if around.has_linear_elements { BY_LINEAR_ELEMENTS } else { BY_ELEMENTS };
    let free = ((1.0 - indentation.depth / depth - SUPPORTED) / -SUPPORTED).clamp(0.0, 1.0);
    let parts = [
        CONSTANT,
        by_elements * indentation.force * material.share / (material.modulus * material.width * depth),
        by_size(response, &around, radius, (free, depth)),
        local_error(tool, response),
        known * BY_SERIES * 0.01 * fraction.powi(3),
        (1.0 - known) * BY_DEPTH * ((depth + around.by_loads.length()) * inverse_thickness).powi(2),
        BY_OTHERS * around.by_others.length() / depth * (depth / radius).min(1.0),
        sticking(material.poisson) * (around.friction / STICKING).min(1.0),
        if contact.local.is_fading { ON_PLANE } else { 0.0 },
    ];
    // Deeper than that the force stays what it is there.
    let most = (MOST_RADII * radius).min(MOST_THICKNESS / inverse_thickness);
    let beyond = if tool.shape.needs_cells() { 0.0 } else { (indentation.depth - most).max(0.0) };
    let local = 1.0 - (indentation.stiffness * beyond / indentation.force).clamp(0.0, 1.0);
    let series = 1.0 - known * (1.0 - SERIES_REACH / fraction.max(SERIES_REACH));
    let held = local.min(series);
    // The force that is held would go on growing.
    ForceError { relative: parts.iter().sum::<f64>() + (1.0 - held), held }
}

/// Error by the thickness and the breadth of the body, for a tool of a radius; `free` is zero above a support and one for a plate or a column.
fn by_size(response: &LocalResponse, around: &Surroundings, radius: f64, (free, depth): (f64, f64)) -> f64 {
    let indentation = &response.indentation;
    let material = &indentation.material;
    let [wide, broad] = [around.inverse_thickness, around.inverse_breadth].map(|inverse| material.width * inverse);
    let (thin, cube) = (wide.min(1.0), broad.powi(3));
    let coarse = wide.max(1.0);
    let plate = ((wide - PLATE[0]) / (PLATE[1] - PLATE[0])).clamp(0.0, 1.0) * coarse * coarse.sqrt();
    let volumetric = (1.0 / (1.0 - 2.0 * material.poisson)).min(MOST_INCOMPRESSIBLE);
    let column = BY_BREADTH[1] * (cube * cube).min(MOST_BREADTH) * (1.0 - thin);
    let s = (indentation.depth / radius).clamp(0.0, DEEPEST * DEEPEST).sqrt();
    let stiffening = (material.share * correction(material, s)).max(0.0);
    (1.0 - free) * (BY_BREADTH[0] * cube.min(1.0) + BY_SQUEEZING * thin * depth * around.inverse_thickness)
        + free * (column + plate * BY_BENDING[1].mul_add(volumetric, BY_BENDING[0]))
        + BY_STIFFENING * stiffening * wide.max(broad).min(1.0)
}

/// Relative change of a sphere's force by finite strain at `s = sqrt(d/R)`.
fn correction(material: &LocalMaterial, s: f64) -> f64 {
    let [first, second, third] = material.strain_terms;
    s * (first + s * (second + s * third))
}

/// Error of the half-space.
fn local_error(tool: &ToolModel, response: &LocalResponse) -> f64 {
    let indentation = &response.indentation;
    let material = &indentation.material;
    let correction = |s: f64| correction(material, s).abs();
    if tool.shape.needs_cells() {
        // For Hertz's sphere s = a/R = 3 F / (4 E* a^2).
        let pressure = indentation.force / (material.modulus * indentation.radius.powi(2)).max(f64::MIN_POSITIVE);
        let corrected = matches!(tool.shape, ToolShape::Ellipsoid { .. });
        let part = if corrected { BY_ELLIPSOID } else { BY_SHAPE };
        return part * correction((0.75 * pressure).min(DEEPEST));
    }
    let s = (indentation.depth / tool.shape.thickness()).max(0.0).sqrt();
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
