//! A single node, as Jun, Choi and Cho touch (section 3.3): its stiffness goes to zero with the element size, so this is for
//! comparison with their method, not for measuring forces.

use super::Approach;
use super::stick::Footprint;
use crate::contact::{Refusal, SurfacePoint};
use crate::simulation::covering::Covering;
use crate::simulation::tool::LawKind;

/// The node of the touched triangle that is closest.
pub struct Node;

impl Footprint for Node {
    fn kind(&self) -> LawKind {
        LawKind::Node
    }

    fn cover(&self, approach: &Approach<'_>, centre: &SurfacePoint, covering: &mut Covering) -> Result<(), Refusal> {
        let surface = &approach.body.green.surface;
        let corners = surface.triangles[centre.triangle as usize];
        let squared_distance = |node: u32| surface.positions[node as usize].distance_squared(centre.position);
        let [a, b, c] = corners;
        let closer = |x: u32, y: u32| if squared_distance(y) < squared_distance(x) { y } else { x };
        covering.candidate.set_node(closer(closer(a, b), c));
        Ok(())
    }
}
