//! A body of a scene: its Green's function, its placement, and its optional motion, strain measure and elastic constants.

use std::sync::Arc;

use glam::{DMat3, DQuat};
use palpate_core::Result;
use palpate_core::contact::Moduli;
use palpate_core::dynamics::{Integration, ModalModel, Newmark, Rayleigh};
use palpate_core::green::GreensFunction;
use palpate_core::simulation::{BodyDynamics, BodyModel, KnownSeries, Placement, Pose};
use palpate_core::strain::StrainMeasure;

use crate::store_defaults::moduli_of_store;

/// Modes of a body and how they are integrated.
#[derive(Clone, Debug)]
pub struct Motion {
    /// `omega^2`, ascending (m), 1/s^2.
    pub eigenvalues: Vec<f64>,
    /// Mass-normalised shapes at the surface dofs, row by row (3s x m), 1/sqrt(kg).
    pub shapes: Vec<f64>,
    /// Newmark's scheme; of exact modes its time step, and `delta` as the weight of a step's new force.
    pub newmark: Newmark,
    /// Damping.
    pub rayleigh: Rayleigh,
    /// Whether each mode takes its exact step instead of Newmark's.
    pub exact: bool,
    /// Spring between a patch and its tool, N/m.
    pub coupling: f64,
}

impl Motion {
    /// What a tick needs of it.
    ///
    /// # Errors
    /// Modes or a scheme that cannot be: see [`ModalModel::new`] and [`BodyDynamics::new`].
    pub fn dynamics(&self) -> Result<BodyDynamics> {
        let held = Integration::ExactHeld { dt: self.newmark.dt, weight: self.newmark.delta };
        let integration = if self.exact { held } else { Integration::Newmark(self.newmark) };
        let modes = ModalModel::new(&self.eigenvalues, &self.shapes, &self.rayleigh, integration)?;
        BodyDynamics::new(modes, self.coupling)
    }
}

/// A body of a scene.
#[derive(Clone)]
pub struct Body {
    /// What it is called.
    pub name: String,
    /// Its Green's function.
    pub green: Arc<GreensFunction>,
    /// Where it stands.
    pub placement: Placement,
    /// Elastic constants at its surface; without them only patches and nodes can touch it.
    pub moduli: Option<Moduli>,
    /// What moves it; none answers as if it came to rest within each tick.
    pub motion: Option<Motion>,
    /// How its strain is measured; without it, it is not limited.
    pub strain: Option<Arc<StrainMeasure>>,
    /// Higher orders of its displacement by the radius of spheres; without them contacts have those of a half-space.
    pub series: Vec<Arc<KnownSeries>>,
}

impl Body {
    /// What a store alone says: at rest at the origin, elastic constants as far as the store has them, strain in the plane of
    /// the surface.
    ///
    /// # Errors
    /// Elastic constants that do not belong to the surface.
    pub fn of_store(green: Arc<GreensFunction>) -> Result<Self> {
        let name = green.path.as_deref().and_then(|path| path.file_stem()).unwrap_or_default();
        Ok(Self {
            name: name.to_string_lossy().into_owned(),
            moduli: moduli_of_store(&green)?,
            strain: Some(Arc::new(StrainMeasure::of_surface(&green.surface))),
            placement: Placement::default(),
            motion: None,
            series: vec![],
            green,
        })
    }

    /// The body as a tick sees it.
    ///
    /// # Errors
    /// Constants or modes that do not fit its surface.
    pub fn model(&self) -> Result<BodyModel> {
        let mut body = BodyModel::new(self.green.clone(), self.placement)?;
        if let Some(moduli) = &self.moduli {
            body = body.with_moduli(moduli.clone())?;
            for series in &self.series {
                body = body.with_series(series.clone())?;
            }
        }
        match &self.motion {
            Some(motion) => body.with_dynamics(motion.dynamics()?),
            None => Ok(body),
        }
    }
}

/// From w x y z, made of length one to the last bit.
pub fn unit_quaternion([w, x, y, z]: [f64; 4]) -> DQuat {
    DQuat::from_xyzw(x, y, z, w).normalize()
}

/// As w x y z.
pub fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// Where a device is to be, by a position, m, and an orientation w x y z; where the position is not finite, which takes the tool
/// out of the scene, the orientation is not read.
pub fn device_pose(position: [f64; 3], orientation: [f64; 4]) -> Pose {
    let present = position.iter().all(|x| x.is_finite());
    Pose {
        position: position.into(),
        orientation: if present { unit_quaternion(orientation) } else { DQuat::IDENTITY },
    }
}

/// From a position, m, and a unit quaternion w x y z.
pub fn placement(position: [f64; 3], orientation: [f64; 4]) -> Placement {
    Placement { position: position.into(), rotation: DMat3::from_quat(unit_quaternion(orientation)) }
}
