//! Model of a simulation: bodies, tools and all that is prepared of them before the loop runs.

use std::sync::Arc;

use glam::DQuat;

use super::body::BodyModel;
use super::known_series::KnownSeries;
use super::tool::ToolModel;
use super::{MAX_BODIES, MAX_TOOLS};
use crate::contact::footprint::PressedSurface;
use crate::contact::shape::ToolShape;
use crate::contact::{CompliantBody, Concavities, ConvexEdges, CornerSurface, RegularCompliance};
use crate::memory::Ranges;
use crate::{Error, Result};

/// Bodies and tools. Copies share the prepared data.
#[derive(Clone)]
pub struct Model {
    /// The bodies.
    pub bodies: Vec<BodyModel>,
    /// The tools, one for each device.
    pub tools: Vec<ToolModel>,
    /// By body: the rotation from the world into its frame.
    pub(super) frames: Vec<DQuat>,
    /// By tool and body, for tools under the local law: the compliance of the body beyond the half-space.
    pub(super) regular_compliances: Vec<Vec<Option<Arc<RegularCompliance>>>>,
    /// By tool and body, for such tools that are not spheres: the surface divided into pieces.
    pub(super) pressed_surfaces: Vec<Vec<Option<Arc<PressedSurface>>>>,
    /// By tool and body, for spheres: the sharp convex corners and blades of the surface, where it has any.
    pub(super) corner_surfaces: Vec<Vec<Option<Arc<CornerSurface>>>>,
    /// Sharp convex edges, for spheres under the local law.
    pub(super) convex_edges: Vec<Vec<Option<Arc<ConvexEdges>>>>,
    /// By tool and body, for spheres: where the tool may touch at several places.
    pub(super) concavities: Vec<Vec<Concavities>>,
}

impl Model {
    /// The memory that a tick reads. Memory that a tick writes is left out: the system keeps pages that are written a thousand
    /// times a second.
    pub fn memory(&self) -> Ranges {
        let mut ranges = Ranges::default();
        ranges.add(&self.frames);
        self.bodies.iter().for_each(|body| body.add_memory(&mut ranges));
        for compliance in self.regular_compliances.iter().flatten().flatten() {
            ranges.add(&compliance.fields);
        }
        self.pressed_surfaces.iter().flatten().flatten().for_each(|surface| surface.add_memory(&mut ranges));
        self.corner_surfaces.iter().flatten().flatten().for_each(|surface| surface.add_memory(&mut ranges));
        self.convex_edges.iter().flatten().flatten().for_each(|edges| edges.add_memory(&mut ranges));
        self.concavities.iter().flatten().for_each(|concavities| concavities.add_memory(&mut ranges));
        ranges
    }

    /// Whether any contact may need pressure cells.
    pub(super) fn needs_cells(&self) -> bool {
        self.pressed_surfaces.iter().flatten().any(Option::is_some)
            || self.corner_surfaces.iter().flatten().any(Option::is_some)
    }

    /// Prepares bodies and tools.
    ///
    /// # Errors
    /// Too many of either, or none; a radius or stiffness that is not positive and finite.
    pub fn new(bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        Self::assemble(None, bodies, tools)
    }

    /// A model with other bodies and tools. Prepared data of those that stay are reused.
    ///
    /// # Errors
    /// As of [`Model::new`].
    pub fn changed(&self, bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        Self::assemble(Some(self), bodies, tools)
    }

    fn assemble(previous: Option<&Self>, bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        for (what, count, most) in [("bodies", bodies.len(), MAX_BODIES), ("tools", tools.len(), MAX_TOOLS)] {
            if !(1..=most).contains(&count) {
                return Err(Error::Invalid(format!("a simulation takes 1 to {most} {what}, got {count}")));
            }
        }
        for tool in &tools {
            for (name, value) in [("tool radius", tool.radius), ("maximum stiffness", tool.max_stiffness)] {
                if !(value > 0.0 && value.is_finite()) {
                    return Err(Error::Invalid(format!("the {name} must be positive, got {value}")));
                }
            }
        }
        let mut regular_compliances: Vec<Vec<Option<Arc<RegularCompliance>>>> = Vec::new();
        for (rank, tool) in tools.iter().enumerate() {
            let of_tool = match tools[..rank].iter().position(|other| has_same_compliance(other, tool)) {
                Some(twin) => regular_compliances[twin].clone(),
                None => {
                    let of_body = |body: &BodyModel| match previous.and_then(|previous| previous.regular_of(body, tool))
                    {
                        Some(previous) => Ok(Some(previous)),
                        None => regular_compliance(body, tool),
                    };
                    bodies.iter().map(of_body).collect::<Result<_>>()?
                }
            };
            regular_compliances.push(of_tool);
        }
        let hollows_of = |tool: &ToolModel, body: &BodyModel| match (&body.local, &tool.shape, tool.law.needs_moduli) {
            (Some(local), &ToolShape::Sphere { radius }, true) => Concavities::new(&local.smooth, radius),
            _ => Concavities::default(),
        };
        let concavities = tools.iter().map(|tool| bodies.iter().map(|body| hollows_of(tool, body)).collect()).collect();
        let pressed_of_tool = |(rank, tool): (usize, &ToolModel)| {
            let of_body = |(compliance, body)| pressed_surface(body, tool, compliance);
            regular_compliances[rank].iter().map(Option::as_deref).zip(&bodies).map(of_body).collect()
        };
        let pressed_surfaces = tools.iter().enumerate().map(pressed_of_tool).collect();
        let corners_of_tool = |(rank, tool): (usize, &ToolModel)| {
            let of_body = |(compliance, body)| corner_surface(body, tool, compliance);
            regular_compliances[rank].iter().map(Option::as_deref).zip(&bodies).map(of_body).collect()
        };
        let corner_surfaces = tools.iter().enumerate().map(corners_of_tool).collect();
        let edges_of = |tool: &ToolModel, body: &BodyModel| match (&body.local, &tool.shape, tool.law.needs_moduli) {
            (Some(local), &ToolShape::Sphere { radius }, true) => {
                ConvexEdges::new((&body.loaded, &body.query, &local.smooth), radius).map(Arc::new)
            }
            _ => None,
        };
        let convex_edges = tools.iter().map(|tool| bodies.iter().map(|body| edges_of(tool, body)).collect()).collect();
        let frames = bodies.iter().map(|body| DQuat::from_mat3(&body.placement.rotation.transpose())).collect();
        Ok(Self {
            bodies,
            tools,
            frames,
            regular_compliances,
            pressed_surfaces,
            corner_surfaces,
            convex_edges,
            concavities,
        })
    }

    /// The same model where a body starts with other higher orders of its displacement: see [`BodyModel::with_series`].
    ///
    /// # Errors
    /// A body that there is not, and as of [`BodyModel::with_series`].
    pub fn with_series(&self, body: usize, series: Arc<KnownSeries>) -> Result<Self> {
        let mut model = self.clone();
        let missing = || Error::Invalid(format!("there is no body {body}"));
        let with_series = model.bodies.get(body).ok_or_else(missing)?.clone().with_series(series)?;
        model.bodies[body] = with_series;
        Ok(model)
    }

    /// The regular compliance of such a tool and body, if this model has it.
    fn regular_of(&self, body: &BodyModel, tool: &ToolModel) -> Option<Arc<RegularCompliance>> {
        let body = self.bodies.iter().position(|previous| previous.is_same(body))?;
        let tool = self.tools.iter().position(|previous| has_same_compliance(previous, tool))?;
        self.regular_compliances[tool][body].clone()
    }

    /// Rejects a contact radius that is too large for some body.
    ///
    /// # Errors
    /// See [`PreparedBody::check_contact_radius`](super::PreparedBody::check_contact_radius).
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        self.bodies.iter().try_for_each(|body| body.check_contact_radius(radius))
    }
}

/// Whether two tools have the same regular compliance on a body.
fn has_same_compliance(one: &ToolModel, other: &ToolModel) -> bool {
    other.law == one.law && other.radius == one.radius && other.max_stiffness == one.max_stiffness
}

fn pressed_surface(
    body: &BodyModel,
    tool: &ToolModel,
    compliance: Option<&RegularCompliance>,
) -> Option<Arc<PressedSurface>> {
    let (local, compliance) = (body.local.as_ref()?, compliance?);
    if !tool.shape.needs_cells() {
        return None;
    }
    let thickness = tool.shape.thickness();
    Some(Arc::new(PressedSurface::new(&body.loaded, &body.query, &local.smooth, &compliance.fields, thickness)))
}

fn corner_surface(
    body: &BodyModel,
    tool: &ToolModel,
    compliance: Option<&RegularCompliance>,
) -> Option<Arc<CornerSurface>> {
    let (local, compliance) = (body.local.as_ref()?, compliance?);
    let ToolShape::Sphere { radius } = tool.shape else { return None };
    let (surface, query, smooth) = (&body.loaded, &body.query, &local.smooth);
    let pressed = || PressedSurface::new(surface, query, smooth, &compliance.fields, radius);
    CornerSurface::new((surface, query, smooth), radius, pressed).map(Arc::new)
}

fn regular_compliance(body: &BodyModel, tool: &ToolModel) -> Result<Option<Arc<RegularCompliance>>> {
    if !tool.law.needs_moduli {
        return Ok(None);
    }
    let local = body.local.as_ref().ok_or_else(|| {
        Error::Invalid("the local contact law needs the elastic constants of the body at its surface".into())
    })?;
    let (green, geometry) = (&*body.green, &body.geometry);
    let (smooth, moduli, moves) = (&local.smooth, &local.moduli, body.moves());
    let inverse_sizes = &local.inverse_sizes;
    let compliant = CompliantBody { green, geometry, smooth, moduli, inverse_sizes, moves };
    let radii = [tool.radius, tool.spreading_radius()];
    Ok(Some(Arc::new(RegularCompliance::load_or_compute(compliant, radii, tool.max_stiffness))))
}
