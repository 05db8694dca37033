//! A body of a simulation: its Green's function, its surface prepared for contact, its dynamics.

use std::sync::Arc;

use glam::DVec3;

use super::MAX_TOOLS;
use super::contacts::Contact;
use super::input::Placement;
use super::known_series::KnownSeries;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{DrawnSurface, Fan, FootPoint, Neighbourhood, SmoothSurface};
use crate::contact::{
    Moduli, PatchGeometry, SeriesFields, SurfacePoint, SurfaceQuery, barycentric, is_thin_at, known_fans, thickness_for,
};
use crate::dynamics::ModalModel;
use crate::green::GreensFunction;
use crate::math::sincos;
use crate::memory::Ranges;
use crate::mesh::Surface;
use crate::{Error, Result};

/// Shortest and longest time step, s. A tick makes at most ten of the shortest; the longest is ten ticks.
pub(super) const TIME_STEPS: std::ops::RangeInclusive<f64> = 1e-4..=1e-2;

/// Depth from which the thickness of a body is measured, over the mean length of edges.
const BELOW_SURFACE: f64 = 0.05;
/// Number of lines along which its breadth is measured.
const DIRECTIONS: u32 = 8;

/// Dynamics of a body: its modes at the surface dofs, and the coupling to a tool.
pub struct BodyDynamics {
    pub(crate) modes: ModalModel,
    /// Spring between a patch and its tool, N/m.
    pub coupling: f64,
}

impl BodyDynamics {
    /// `modes` has a row for every surface dof.
    ///
    /// # Errors
    /// A time step out of range, or a coupling that is not positive.
    pub fn new(modes: ModalModel, coupling: f64) -> Result<Self> {
        if !TIME_STEPS.contains(&modes.dt) {
            let (low, high) = (TIME_STEPS.start(), TIME_STEPS.end());
            return Err(Error::Invalid(format!("the time step must lie between {low} and {high} s, got {}", modes.dt)));
        }
        if !(coupling > 0.0 && coupling.is_finite()) {
            return Err(Error::Invalid(format!("the coupling must be positive, got {coupling} N/m")));
        }
        Ok(Self { modes, coupling })
    }
}

/// Surface of a body prepared for the local law.
pub struct LocalSurface {
    /// The surface under the reference loads, smooth between the nodes.
    pub smooth: SmoothSurface,
    /// Elastic constants at the surface nodes.
    pub moduli: Moduli,
    /// The largest `E/(1 - nu^2)` of them, Pa.
    pub largest_modulus: f64,
    /// Corners of the box around the surface, m.
    pub bounds: [DVec3; 2],
    /// At each fan of the smooth surface one over the thickness of the body below, and over its breadth: the distance through it
    /// along lines inclined by 60 degrees, 1/m.
    pub inverse_sizes: Vec<[f64; 2]>,
    /// Whether a material at the surface has a law beyond small strain.
    pub is_hyperelastic: bool,
}

/// A body of a scene. Copies share the prepared data.
#[derive(Clone)]
pub struct BodyModel {
    /// Position and rotation in the world.
    pub placement: Placement,
    /// Higher orders of the displacement that a simulation starts with.
    pub(super) series: Vec<Arc<KnownSeries>>,
    prepared: Arc<PreparedBody>,
}

/// Prepared data of a body, in its own frame.
pub struct PreparedBody {
    pub(crate) green: Arc<GreensFunction>,
    /// Displacements of the surface under the reference loads, m (3s).
    pub(super) free: Vec<f64>,
    pub(super) query: SurfaceQuery,
    /// The surface under the reference loads.
    pub(super) loaded: Surface,
    /// Faces at rest, prepared for the quadrature of contact weights.
    pub(crate) geometry: PatchGeometry,
    /// Dynamics; without them the body is at rest in each tick.
    pub(super) dynamics: Option<BodyDynamics>,
    /// Mean length of the edges of the drawn triangles, m.
    pub(super) mean_edge: f64,
    /// Data of the local law; without them only the laws `patch` and `node` can be used.
    pub(super) local: Option<LocalSurface>,
}

impl BodyModel {
    /// Prepares the surface.
    ///
    /// # Errors
    /// A surface that cannot be searched.
    pub fn new(green: Arc<GreensFunction>, placement: Placement) -> Result<Self> {
        let free = green.free_displacements();
        let shifts = free.chunks_exact(3).map(DVec3::from_slice);
        let positions = green.surface.positions.iter().zip(shifts).map(|(&p, u)| p + u).collect();
        let loaded = Surface::new(positions, green.surface.faces.clone())?;
        let query = SurfaceQuery::new(&loaded)?;
        let geometry = PatchGeometry::new(&green.surface);
        let mean_edge = mean_edge(&green.surface);
        let prepared = PreparedBody { green, free, query, loaded, geometry, dynamics: None, mean_edge, local: None };
        Ok(Self { placement, series: Vec::new(), prepared: Arc::new(prepared) })
    }

    /// The same body, ready for the local law.
    ///
    /// # Errors
    /// Elastic constants that are not given at every surface node, or out of range.
    pub fn with_moduli(self, moduli: Moduli) -> Result<Self> {
        let (nodes, given) = (self.green.surface_count(), moduli.youngs.len());
        if given != nodes || moduli.poissons.len() != nodes || moduli.strain_terms.len() != nodes {
            return Err(Error::Invalid(format!("elastic constants at {given} nodes, the surface has {nodes}")));
        }
        let valid = |(&e, &nu): (&f64, &f64)| e > 0.0 && e.is_finite() && nu > -1.0 && nu < 0.5;
        if !moduli.youngs.iter().zip(&moduli.poissons).all(valid) {
            return Err(Error::Invalid("elastic constants at the surface are out of range".into()));
        }
        let smooth = SmoothSurface::new(&self.loaded);
        let known = known_fans(&self.green, &self.geometry, &smooth);
        let smooth = smooth.touchable_at(known);
        let largest_modulus = (0..nodes as u32).map(|node| moduli.plane_strain(node)).fold(0.0, f64::max);
        let corner =
            |of: fn(DVec3, DVec3) -> DVec3| self.loaded.positions.iter().copied().reduce(of).unwrap_or_default();
        let bounds = [corner(DVec3::min), corner(DVec3::max)];
        let is_hyperelastic = moduli.strain_terms.iter().any(|terms| *terms != [0.0; 3]);
        let inverse_sizes = match is_hyperelastic {
            true => smooth.fans().iter().map(|fan| inverse_sizes(&self.query, fan, self.mean_edge)).collect(),
            false => vec![[0.0; 2]; smooth.fans().len()],
        };
        let local = LocalSurface { smooth, moduli, largest_modulus, bounds, inverse_sizes, is_hyperelastic };
        self.preparing(|prepared| prepared.local = Some(local))
    }

    /// The same body with higher orders of its displacement for one more radius, or others for a radius that it has. A simulation may
    /// take up more of them while it runs: see [`State::take_series`](super::State::take_series). Without fields nothing is known yet.
    ///
    /// # Errors
    /// A body without elastic constants, coefficients of another surface, or more radii than tools.
    pub fn with_series(mut self, mut series: Arc<KnownSeries>) -> Result<Self> {
        let fans = self.fan_count();
        if series.fields.is_empty() {
            Arc::make_mut(&mut series).fields = vec![SeriesFields::default(); fans];
        }
        let given = series.fields.len();
        if given != fans {
            return Err(Error::Invalid(format!("a series at {given} places, the surface has {fans}")));
        }
        self.series.retain(|known| known.radius != series.radius);
        if self.series.len() == MAX_TOOLS {
            return Err(Error::Invalid(format!("a body has series for at most {MAX_TOOLS} radii")));
        }
        self.series.push(series);
        Ok(self)
    }

    /// The same body in motion.
    ///
    /// # Errors
    /// Modes that are not given at every surface dof.
    pub fn with_dynamics(self, dynamics: BodyDynamics) -> Result<Self> {
        let (rows, dofs) = (dynamics.modes.rows(), self.free.len());
        if rows != dofs {
            return Err(Error::Invalid(format!("the modes have {rows} rows, the surface has {dofs} dofs")));
        }
        self.preparing(|prepared| prepared.dynamics = Some(dynamics))
    }

    /// Whether the body below a contact, in the body's frame, is too thin for the local law under a tool of this shape.
    pub fn is_thin_below(&self, contact: &Contact, shape: &ToolShape) -> bool {
        is_thin_at(&self.query, &self.loaded, contact.point, contact.normal, thickness_for(shape))
    }

    /// Displacement of a surface node by the loads of the body, m.
    pub(super) fn load_displacement(&self, node: usize) -> DVec3 {
        DVec3::from_slice(&self.free[3 * node..][..3])
    }

    /// Adds prepared data, before they are shared.
    fn preparing(mut self, complete: impl FnOnce(&mut PreparedBody)) -> Result<Self> {
        let shared = || Error::Invalid("the body is part of a scene already: it cannot be changed".into());
        complete(Arc::get_mut(&mut self.prepared).ok_or_else(shared)?);
        Ok(self)
    }

    /// The same body at another placement.
    pub fn placed(&self, placement: Placement) -> Self {
        Self { placement, ..self.clone() }
    }

    /// Adds the memory that a tick reads.
    pub(super) fn add_memory(&self, ranges: &mut Ranges) {
        self.prepared.add_memory(ranges);
        self.series.iter().for_each(|series| ranges.add(&series.fields));
    }

    /// Series that a simulation starts with.
    pub fn series(&self) -> &[Arc<KnownSeries>] {
        &self.series
    }

    /// Whether both are the same body, whatever their placements.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.prepared, &other.prepared)
    }
}

impl std::ops::Deref for BodyModel {
    type Target = PreparedBody;

    fn deref(&self) -> &PreparedBody {
        &self.prepared
    }
}

impl PreparedBody {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        self.green.add_memory(ranges);
        self.loaded.add_memory(ranges);
        self.query.add_memory(ranges);
        self.geometry.add_memory(ranges);
        ranges.add(&self.free);
        if let Some(local) = &self.local {
            local.smooth.add_memory(ranges);
            local.moduli.add_memory(ranges);
            ranges.add(&local.inverse_sizes);
        }
        if let Some(dynamics) = &self.dynamics {
            dynamics.modes.add_memory(ranges);
        }
    }

    /// The body's Green's function.
    pub fn green(&self) -> &GreensFunction {
        &self.green
    }

    /// Whether a material at the surface has a law beyond small strain.
    pub fn is_hyperelastic(&self) -> bool {
        self.local.as_ref().is_some_and(|local| local.is_hyperelastic)
    }

    /// Number of fans of its smooth surface; zero without elastic constants.
    pub fn fan_count(&self) -> usize {
        self.local.as_ref().map_or(0, |local| local.smooth.fans().len())
    }

    /// Whether the body moves.
    pub fn moves(&self) -> bool {
        self.dynamics.is_some()
    }

    /// Displacements of the surface dofs under the reference loads, m (3s).
    pub fn free_displacements(&self) -> &[f64] {
        &self.free
    }

    /// Closest point of the smooth surface of the local law, in the body's frame. `None` without that law, or for a point that is
    /// not finite.
    pub fn foot(&self, point: DVec3) -> Option<FootPoint> {
        let smooth = &self.local.as_ref()?.smooth;
        smooth.foot_anywhere(self.drawn(), point, &mut Neighbourhood::new(std::iter::once(smooth)))
    }

    /// The drawn surface under the reference loads.
    pub(super) fn drawn(&self) -> DrawnSurface<'_> {
        DrawnSurface { surface: &self.loaded, query: &self.query }
    }

    /// The point of the drawn triangle at a foot.
    pub(super) fn surface_point(&self, foot: &FootPoint) -> SurfacePoint {
        let [of_a, of_b, _] = barycentric(self.loaded.corners(foot.triangle), foot.position);
        let of_a = of_a.clamp(0.0, 1.0);
        let of_b = of_b.clamp(0.0, 1.0 - of_a);
        SurfacePoint {
            position: foot.position,
            triangle: foot.triangle,
            barycentric: [of_a, of_b, 1.0 - of_a - of_b],
            normal: foot.normal,
            signed_distance: foot.distance,
        }
    }

    /// Point of the loaded surface, untouched by tools, that is closest to `point`.
    pub(super) fn closest(&self, point: DVec3) -> Option<SurfacePoint> {
        self.query.closest(&self.loaded, point)
    }

    /// Position in the unloaded body of the material at a point of the loaded surface. Weights are taken there, so that a contact
    /// has the same nodes whatever the loads.
    pub(super) fn material_point(&self, loaded: &SurfacePoint) -> SurfacePoint {
        let corners = self.green.surface.corners(loaded.triangle);
        let position = corners.into_iter().zip(loaded.barycentric).map(|(p, n)| n * p).sum();
        SurfacePoint { position, ..*loaded }
    }

    /// Rejects a contact radius under which some contact could have more nodes than a patch may have.
    ///
    /// # Errors
    /// The radius, with the largest that is allowed.
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(Error::Invalid(format!("the contact radius must not be negative, got {radius} m")));
        }
        self.geometry.check_radius(&self.green, radius)
    }
}

/// One over thickness and breadth of a body at a fan, 1/m.
fn inverse_sizes(query: &SurfaceQuery, fan: &Fan, mean_edge: f64) -> [f64; 2] {
    // From below the faces around.
    let inside = BELOW_SURFACE * mean_edge;
    let inward = -fan.normal;
    let inverse = |direction: DVec3| 1.0 / (inside + query.distance_along(fan.position + inward * inside, direction));
    let (first, second) = inward.any_orthonormal_pair();
    let inclined = (0..DIRECTIONS).map(|k| {
        let (sin, cos) = sincos(std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS));
        inverse(inward * 0.5 + (first * cos + second * sin) * 0.75f64.sqrt()).powi(2)
    });
    let mean_square = inclined.sum::<f64>() / f64::from(DIRECTIONS);
    [inverse(inward), mean_square.sqrt()]
}

fn mean_edge(surface: &Surface) -> f64 {
    let lengths = surface.triangles.iter().flat_map(|t| {
        let [a, b, c] = t.map(|n| surface.positions[n as usize]);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    lengths.sum::<f64>() / (3 * surface.triangles.len()).max(1) as f64
}
