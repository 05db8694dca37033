//! Contact at a single node, as in Jun, Choi and Cho (section 3.3). Its stiffness goes to zero with the element size: it serves to
//! compare with their method, not to measure forces.

use super::Approach;
use super::stick::Footprint;
use crate::contact::{Refusal, SurfacePoint};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

impl LawKind {
    /// The contact of Jun, Choi and Cho: the node closest to where the tool first touched.
    pub const NODE: Self = Self { name: "node", needs_moduli: false };
}

/// The node of the touched triangle that is closest.
pub struct Node;

impl Footprint for Node {
    fn kind(&self) -> LawKind {
        LawKind::NODE
    }

    fn weigh(
        &self,
        approach: &Approach<'_>,
        centre: &SurfacePoint,
        weight_scratch: &mut WeightScratch,
    ) -> Result<(), Refusal> {
        let surface = &approach.body.green.surface;
        let corners = surface.triangles[centre.triangle as usize];
        let squared_distance = |node: u32| surface.positions[node as usize].distance_squared(centre.position);
        let [a, b, c] = corners;
        let closer = |x: u32, y: u32| if squared_distance(y) < squared_distance(x) { y } else { x };
        weight_scratch.candidate.set_node(closer(closer(a, b), c));
        Ok(())
    }
}
