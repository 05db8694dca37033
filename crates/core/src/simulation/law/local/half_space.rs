//! The two sides of a local contact, the half-space in place of the body there, and its indentation.

use glam::DVec3;

use crate::contact::footprint::PressedSurface;
use crate::contact::local::{SeriesFields, StrainTerms, effective_modulus, terms_with_pad};
use crate::contact::regular::{FanFields, INVERSE_MODULUS, POISSON, STRAIN_TERMS, WIDTH};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{Blended, DrawnSurface, SmoothSurface};
use crate::contact::{ConvexEdges, CornerSurface};

/// Data of a body for one tool.
#[derive(Clone, Copy)]
pub struct LocalBody<'a> {
    pub drawn: DrawnSurface<'a>,
    pub smooth: &'a SmoothSurface,
    /// Curvatures, moduli and regular compliance at the fans.
    pub fields: &'a [FanFields],
    /// Higher orders of the displacement at the fans, where they are known.
    pub series: Option<&'a [SeriesFields]>,
    /// The surface in pieces, for a tool that is not a sphere.
    pub pressed_surface: Option<&'a PressedSurface>,
    /// Its sharp convex corners and blades, for a sphere.
    pub corners: Option<&'a CornerSurface>,
    /// Its sharp convex edges, for a sphere.
    pub edges: Option<&'a ConvexEdges>,
    /// Young's modulus over the Green's function's.
    pub scale: f64,
    /// Whether a material at its surface has a law beyond small strain.
    pub is_hyperelastic: bool,
}

/// The tool and its friction.
#[derive(Clone, Copy)]
pub struct LocalTool<'a> {
    /// Its shape.
    pub shape: &'a ToolShape,
    /// Size of the part that touches, m: of a sphere its radius.
    pub radius: f64,
    /// Young's modulus of its pad, Pa; a rigid one has none.
    pub pad: Option<f64>,
    /// Coulomb's coefficient.
    pub coefficient: f64,
}

/// Fields blended at a foot.
pub type Fields = Blended<{ size_of::<FanFields>() / size_of::<f64>() }>;

/// Constants of the body at a contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalMaterial {
    pub poisson: f64,
    pub strain_terms: StrainTerms,
    /// `E*` of body and pad over `E/(1 - nu^2)` of the body.
    pub share: f64,
    /// `E*`, Pa.
    pub modulus: f64,
    /// Radius of the patch from which the compliance of the body was taken, m.
    pub width: f64,
}

/// The half-space below a tool.
pub struct HalfSpace {
    /// Constants at the contact.
    pub material: LocalMaterial,
    /// `E*`, Pa, and its gradient by the position of the foot's point.
    pub modulus: f64,
    pub slope: DVec3,
    /// Its derivative by the field of the inverse modulus.
    pub by_inverse_modulus: f64,
    /// `k_t / k_n`.
    pub tangential: f64,
    /// Coefficients of finite strain, and their gradients by the position of the foot's point.
    pub strain_terms: StrainTerms,
    pub strain_slopes: [DVec3; 3],
    /// Radius over which the body's own compliance spreads a force, m, and its gradient by the position of the foot's point.
    pub width: f64,
    pub width_slope: DVec3,
}

impl HalfSpace {
    /// From the body's constants at the foot and the tool's pad; a contact has a `part` of its modulus.
    pub fn new(body: LocalBody<'_>, tool: LocalTool<'_>, fields: &Fields, part: f64) -> Self {
        let own = body.scale / fields.values[INVERSE_MODULUS];
        let own_by_inverse = -own / fields.values[INVERSE_MODULUS];
        let whole = effective_modulus(own, 0.0, tool.pad);
        let modulus = part * whole;
        let by_inverse_modulus = part * (whole / own).powi(2) * own_by_inverse;
        let slope = fields.slope(INVERSE_MODULUS) * by_inverse_modulus;
        let poisson = fields.values[POISSON];
        let tangential = 2.0 * (1.0 - poisson) / (2.0 - poisson);
        let body_terms: StrainTerms = std::array::from_fn(|k| fields.values[STRAIN_TERMS.start + k]);
        let share = whole / own;
        let (mut strain_terms, mut strain_slopes) = ([0.0; 3], [DVec3::ZERO; 3]);
        if body.is_hyperelastic {
            let by_own;
            (strain_terms, by_own) = terms_with_pad(&body_terms, share, own);
            let body_slope = fields.slope(INVERSE_MODULUS) * own_by_inverse;
            strain_slopes = std::array::from_fn(|k| {
                fields.slope(STRAIN_TERMS.start + k) * share.powi(k as i32 + 2) + body_slope * by_own[k]
            });
        }
        Self {
            material: LocalMaterial { poisson, strain_terms: body_terms, share, modulus, width: fields.values[WIDTH] },
            modulus,
            slope,
            by_inverse_modulus,
            tangential,
            strain_terms,
            strain_slopes,
            width: fields.values[WIDTH],
            width_slope: fields.slope(WIDTH),
        }
    }
}

/// Energy of the local contact at a position, and its gradient without friction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Indentation {
    /// Constants of body and tool.
    pub material: LocalMaterial,
    /// Depth of the tool in the surface, m.
    pub depth: f64,
    /// Normal force, N.
    pub force: f64,
    /// Contact radius, or that of the circle of the same stiffness, m.
    pub radius: f64,
    /// Normal stiffness, N/m.
    pub stiffness: f64,
    /// J.
    pub energy: f64,
    /// `dPhi/dp'`, N.
    pub gradient: DVec3,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
    /// Vector from the tip to the point where friction acts, m.
    pub lever: DVec3,
    /// `k_t / k_n`.
    pub tangential: f64,
}
