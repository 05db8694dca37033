//! Reasons why no contact begins.

/// Reason why no contact begins at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A node under the contact lies outside the touch region; its rank among the surface nodes.
    NotTouchable(u32),
    /// The contact covers more than [`super::MAX_PATCH_NODES`] nodes.
    TooManyNodes,
}

impl Refusal {
    /// Message of one line.
    pub fn message(self) -> &'static str {
        match self {
            Refusal::NotTouchable(_) => "the contact reaches outside the touch region",
            Refusal::TooManyNodes => "the contact covers too many nodes: choose a smaller contact radius",
        }
    }
}
