//! What is fixed while a simulation runs, and its reusable memory.

use std::sync::Arc;

use glam::DVec3;

use super::{Dynamics, Motion, State};
use crate::contact::{MAX_PATCH_NODES, Patch, PatchScratch, SurfacePoint, SurfaceQuery, patch_weights};
use crate::green::GreensFunction;
use crate::mesh::Surface;
use crate::{Error, Result};

/// A body's Green's function, its surface prepared for contact, and the tool.
pub struct Model {
    pub(crate) green: Arc<GreensFunction>,
    /// Displacements of the surface under the reference loads, m (3s): the shape that tools meet.
    pub(crate) free: Vec<f64>,
    pub(crate) query: SurfaceQuery,
    /// The surface under the reference loads.
    pub(super) loaded: Surface,
    /// What moves the body; none answers as if it came to rest within each tick.
    pub(crate) dynamics: Option<Dynamics>,
    /// Radius of the tool sphere, m.
    pub tool_radius: f64,
    /// Stiffest contact rendered, N/m: near a support the body alone would be rigid, which no device can render.
    pub max_stiffness: f64,
}

/// Memory a tick needs, sized once.
pub struct Scratch {
    pub(crate) patch: PatchScratch,
    pub(crate) candidate: Patch,
}

impl Model {
    /// Prepares the surface.
    ///
    /// # Errors
    /// A radius or stiffness that is not positive and finite.
    pub fn new(green: Arc<GreensFunction>, tool_radius: f64, max_stiffness: f64) -> Result<Self> {
        for (name, value) in [("tool radius", tool_radius), ("maximum stiffness", max_stiffness)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Invalid(format!("the {name} must be positive, got {value}")));
            }
        }
        let free = green.free_displacements();
        let shifts = free.chunks_exact(3).map(DVec3::from_slice);
        let positions = green.surface.positions.iter().zip(shifts).map(|(&p, u)| p + u).collect();
        let loaded = Surface::new(positions, green.surface.faces.clone())?;
        let query = SurfaceQuery::new(&loaded)?;
        Ok(Self { green, free, query, loaded, tool_radius, max_stiffness, dynamics: None })
    }

    /// The same body in motion.
    ///
    /// # Errors
    /// Modes that are not given at every surface dof.
    pub fn with_dynamics(self, dynamics: Dynamics) -> Result<Self> {
        let (rows, dofs) = (dynamics.modes.rows(), self.free.len());
        if rows != dofs {
            return Err(Error::Invalid(format!("the modes have {rows} rows, the surface has {dofs} dofs")));
        }
        Ok(Self { dynamics: Some(dynamics), ..self })
    }

    /// Point of the loaded surface, untouched by tools, that is closest to `point`.
    pub(crate) fn closest(&self, point: DVec3) -> Option<SurfacePoint> {
        self.query.closest(&self.loaded, point)
    }

    /// Where the material under a point of the loaded surface is in the unloaded body. Weights are taken there, so that
    /// a contact carries the same nodes whatever the loads.
    pub(crate) fn material_point(&self, loaded: &SurfacePoint) -> SurfacePoint {
        let corners = self.green.surface.corners(loaded.triangle);
        let position = corners.into_iter().zip(loaded.barycentric).map(|(p, n)| n * p).sum();
        SurfacePoint { position, ..*loaded }
    }

    /// The Green's function behind the model.
    pub fn green(&self) -> &GreensFunction {
        &self.green
    }

    /// A state at rest, nothing touched.
    pub fn state(&self) -> State {
        State { motion: self.dynamics.as_ref().map(|d| Motion::new(&d.modes)), ..State::default() }
    }

    /// Memory for [`super::step`].
    pub fn scratch(&self) -> Scratch {
        Scratch { patch: PatchScratch::new(&self.green.surface), candidate: Patch::default() }
    }

    /// Refuses a contact radius under which some contact would cover more nodes than a tick can weigh.
    ///
    /// # Errors
    /// The radius, with the number of nodes and the limit.
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(Error::Invalid(format!("the contact radius must not be negative, got {radius} m")));
        }
        let surface = &self.green.surface;
        let mut scratch = self.scratch();
        for triangle in 0..surface.triangles.len() as u32 {
            let corners = surface.corners(triangle);
            let position: DVec3 = (corners[0] + corners[1] + corners[2]) / 3.0;
            let normal = surface.normals[triangle as usize];
            let centre = SurfacePoint { position, triangle, barycentric: [1.0 / 3.0; 3], normal, signed_distance: 0.0 };
            let covered = patch_weights(surface, &centre, radius, &mut scratch.patch, &mut scratch.candidate);
            if covered > MAX_PATCH_NODES {
                return Err(Error::Invalid(format!(
                    "a contact radius of {radius} m covers {covered} surface nodes, the limit is {MAX_PATCH_NODES}: \
                     choose a smaller radius or a coarser mesh"
                )));
            }
        }
        Ok(())
    }
}
