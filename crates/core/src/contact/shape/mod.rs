//! Shapes of rigid tools, in the tool's own frame; m.
//!
//! The origin is the point at the device's position: the centre of a sphere, of an ellipsoid and of the hemisphere in front of
//! a capsule, the middle of a punch's face. Capsule and punch lie along +z, their front towards -z.

mod capsule;
pub(crate) mod ellipsoid;
mod punch;
mod spline;
mod surface;
mod turning;

use glam::{DMat3, DVec3};

pub use surface::SurfaceShape;

use crate::math::hypot;
use crate::tensor::outer;
use crate::{Error, Result};

/// Extent that counts of a tool that is round, over that of a long one.
const ROUND_EXTENT: f64 = 2e-3;

/// Shape of a tool.
#[derive(Clone, Debug)]
pub enum ToolShape {
    /// A sphere around the origin.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// An ellipsoid around the origin.
    Ellipsoid {
        /// Half its lengths along x, y and z, m.
        semi_axes: DVec3,
    },
    /// A cylinder along +z with a hemisphere around the origin and one at its other end.
    Capsule {
        /// Radius, m.
        radius: f64,
        /// Half the distance between the centres of the hemispheres, m.
        half_length: f64,
    },
    /// A cylinder along +z, four radii long, whose flat face lies in the plane z = 0.
    Punch {
        /// Radius of the cylinder, m.
        radius: f64,
        /// Radius by which the edges of its faces are rounded, m; at most that of the cylinder.
        rounding: f64,
    },
    /// Any closed surface.
    Surface(Box<SurfaceShape>),
}

/// Point where a straight line enters a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineEntry {
    /// Distance along the line, in units of its direction.
    pub distance: f64,
    /// Unit outward normal of the shape.
    pub normal: DVec3,
}

impl ToolShape {
    /// A shape of a kind by its lengths, m: radius of a sphere, semi-axes of an ellipsoid, radius of a capsule and length of its
    /// cylinder, radius of a punch and rounding of its rim.
    ///
    /// # Errors
    /// A kind that has no lengths, or lengths that are not positive.
    pub fn of_lengths(kind: &str, [a, b, c]: [f64; 3]) -> Result<Self> {
        match kind {
            "sphere" => Self::sphere(a),
            "ellipsoid" => Self::ellipsoid(DVec3::new(a, b, c)),
            "capsule" => Self::capsule(a, 0.5 * b),
            "punch" => Self::punch(a, b),
            other => Err(Error::Invalid(format!("there is no shape '{other}'"))),
        }
    }

    /// A closed surface of vertices, m, and triangles.
    ///
    /// # Errors
    /// See [`SurfaceShape::new`].
    pub fn surface(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self> {
        let vertices: Vec<DVec3> = vertices.iter().map(|&v| v.into()).collect();
        Ok(Self::Surface(Box::new(SurfaceShape::new(&vertices, triangles)?)))
    }

    /// A sphere.
    ///
    /// # Errors
    /// A radius that is not positive.
    pub fn sphere(radius: f64) -> Result<Self> {
        positive("radius of a sphere", radius)?;
        Ok(Self::Sphere { radius })
    }

    /// An ellipsoid.
    ///
    /// # Errors
    /// A semi-axis that is not positive.
    pub fn ellipsoid(semi_axes: DVec3) -> Result<Self> {
        for semi_axis in semi_axes.to_array() {
            positive("semi-axis of an ellipsoid", semi_axis)?;
        }
        Ok(Self::Ellipsoid { semi_axes })
    }

    /// A capsule.
    ///
    /// # Errors
    /// A radius or half length that is not positive.
    pub fn capsule(radius: f64, half_length: f64) -> Result<Self> {
        positive("radius of a capsule", radius)?;
        positive("half length of a capsule", half_length)?;
        Ok(Self::Capsule { radius, half_length })
    }

    /// A flat punch with a rounded rim.
    ///
    /// # Errors
    /// A radius or rounding that is not positive, a rounding larger than the radius.
    pub fn punch(radius: f64, rounding: f64) -> Result<Self> {
        positive("radius of a punch", radius)?;
        positive("rounding of a punch", rounding)?;
        if rounding > radius {
            return Err(Error::Invalid(format!(
                "rounding of a punch is {rounding} m, more than its radius of {radius} m"
            )));
        }
        Ok(Self::Punch { radius, rounding })
    }

    /// Signed distance of a point, m, negative inside, and its gradient: a unit vector away from the shape, and of a surface from a file
    /// nearly one, shorter where its splines round an edge.
    ///
    /// Where several points of the shape are closest, the gradient is that of one of them.
    pub fn signed_distance(&self, point: DVec3) -> (f64, DVec3) {
        match *self {
            Self::Sphere { radius } => distance_to_ball(point, radius),
            Self::Ellipsoid { semi_axes } => ellipsoid::signed_distance(semi_axes, point),
            Self::Capsule { radius, half_length } => {
                let axis_point = DVec3::Z * point.z.clamp(0.0, 2.0 * half_length);
                distance_to_ball(point - axis_point, radius)
            }
            Self::Punch { radius, rounding } => punch::signed_distance(radius, rounding, point),
            Self::Surface(ref surface) => surface.signed_distance(point),
        }
    }

    /// The point that reaches farthest in a direction of any length; of a surface from a file, one that reaches as far or, by
    /// up to 2 % of its size, farther.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        match *self {
            Self::Sphere { radius } => radius * direction.normalize_or_zero(),
            Self::Ellipsoid { semi_axes } => ellipsoid::support(semi_axes, direction),
            Self::Capsule { radius, half_length } => capsule::support(radius, half_length, direction),
            Self::Punch { radius, rounding } => punch::support(radius, rounding, direction),
            Self::Surface(ref surface) => surface.support(direction),
        }
    }

    /// Where the line `origin + s direction` (a unit vector), from an origin outside, first enters the shape. Entries beyond
    /// `reach` may be left out.
    pub fn line_entry(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<LineEntry> {
        match *self {
            Self::Sphere { radius } => ellipsoid::line_entry(DVec3::splat(radius), origin, direction),
            Self::Ellipsoid { semi_axes } => ellipsoid::line_entry(semi_axes, origin, direction),
            Self::Capsule { radius, half_length } => capsule::line_entry(radius, half_length, origin, direction),
            Self::Punch { radius, rounding } => punch::line_entry((radius, rounding), origin, direction, reach),
            Self::Surface(ref surface) => surface.line_entry(origin, direction, reach),
        }
    }

    /// Centre of a ball around the shape.
    pub fn centre(&self) -> DVec3 {
        match *self {
            Self::Sphere { .. } | Self::Ellipsoid { .. } => DVec3::ZERO,
            Self::Capsule { half_length, .. } => DVec3::Z * half_length,
            Self::Punch { radius, .. } => DVec3::Z * (0.5 * punch::LENGTH * radius),
            Self::Surface(ref surface) => surface.centre,
        }
    }

    /// Whether its contact has no closed form: its pressure is computed on cells.
    pub fn needs_cells(&self) -> bool {
        !matches!(self, ToolShape::Sphere { .. })
    }

    /// Radius of the ball around [`ToolShape::centre`], m.
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Ellipsoid { semi_axes } => semi_axes.max_element(),
            Self::Capsule { radius, half_length } => radius + half_length,
            Self::Punch { radius, .. } => radius * hypot(0.5 * punch::LENGTH, 1.0),
            Self::Surface(ref surface) => surface.bounding_radius,
        }
    }

    /// Depth below its surface to which [`ToolShape::rounded_gradient`] is that of one side, m.
    pub fn reach(&self) -> f64 {
        match *self {
            Self::Sphere { radius } | Self::Capsule { radius, .. } => radius,
            Self::Ellipsoid { semi_axes } => semi_axes.min_element().powi(2) / semi_axes.max_element(),
            Self::Punch { radius, rounding } => punch::at_least_rounded(radius, rounding),
            Self::Surface(ref surface) => surface.inner_radius,
        }
    }

    /// Half its width where it is narrowest, m.
    // Inlined, the lengths of other kinds are read before the kind is looked at: without effect, but valgrind reports it.
    #[inline(never)]
    pub fn thickness(&self) -> f64 {
        match *self {
            Self::Sphere { radius } | Self::Capsule { radius, .. } | Self::Punch { radius, .. } => radius,
            Self::Ellipsoid { semi_axes } => semi_axes.min_element(),
            Self::Surface(ref surface) => surface.thickness,
        }
    }

    /// A symmetric matrix, largest along the direction in which the shape is longest, and one there. Seen along any direction the
    /// shape is longest along the axis of the matrix across it, and so are most contacts.
    pub fn extents(&self) -> DMat3 {
        let along = |axis: DVec3| outer(axis, axis);
        match *self {
            Self::Sphere { .. } => along(DVec3::Z) * ROUND_EXTENT,
            // One that stands upright is round too, and the cells have to keep a direction. Between the axes of the tool: edges are
            // often parallel to these, and a row of cells that passes an edge at once has no exact gradient.
            Self::Capsule { .. } => along(DVec3::Z) + along(DVec3::new(0.8, 0.6, 0.0)) * ROUND_EXTENT,
            // Along an axis of the tool, the cells end with a grid of taxels.
            Self::Punch { .. } => along(DVec3::Z) + along(DVec3::X) * ROUND_EXTENT,
            // That of its shadow.
            Self::Ellipsoid { semi_axes } => {
                let parts = semi_axes / semi_axes.max_element();
                DMat3::from_diagonal(parts * parts)
            }
            Self::Surface(ref surface) => along(surface.long_axis),
        }
    }
}

/// Rejects numbers that are not positive lengths.
fn positive(what: &str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::Invalid(format!("{what} is {value} m: it must be positive")))
}

/// Signed distance to a ball around the origin, and its gradient.
fn distance_to_ball(point: DVec3, radius: f64) -> (f64, DVec3) {
    let length = point.length();
    (length - radius, if length > 0.0 { point / length } else { DVec3::NEG_Z })
}

#[cfg(test)]
pub(crate) mod tests;
