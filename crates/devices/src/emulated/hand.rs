//! Model of a person's hand: mass, damper and spring towards a target.
//!
//! The tip is held firmly, so that hand and tip move as one, and muscles with their reflexes act like a spring and a damper
//! towards where the hand wants to be.

use glam::DVec3;

/// A hand: what it adds to a tip, and where it wants to be.
#[derive(Clone, Debug)]
pub struct Hand {
    /// That moves along with the tip, kg.
    pub mass: f64,
    /// N s/m.
    pub damping: f64,
    /// Of the muscles, N/m.
    pub stiffness: f64,
    /// Where it wants to be.
    pub target: HandTarget,
}

/// Target of a hand: its position if no force acts on it.
#[derive(Clone, Debug, PartialEq)]
pub enum HandTarget {
    /// At one place, m.
    At(DVec3),
    /// Where the waypoints lead, in the order of their times: at the first one before, at the last one afterwards.
    Along(Vec<Waypoint>),
}

/// A place to be at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Since the tip was made, s.
    pub time: f64,
    /// m.
    pub position: DVec3,
}

impl HandTarget {
    /// Place at a time, m. From one waypoint to the next the hand wants to move with the least jerk, from rest to rest, as people
    /// reach (Flash and Hogan, The coordination of arm movements, J. Neuroscience 5, 1985):
    /// `10 s^3 - 15 s^4 + 6 s^5` of the way.
    pub fn at(&self, time: f64) -> DVec3 {
        match self {
            HandTarget::At(position) => *position,
            HandTarget::Along(waypoints) => {
                let next = waypoints.partition_point(|waypoint| waypoint.time <= time);
                match (next.checked_sub(1).map(|last| waypoints[last]), waypoints.get(next)) {
                    (Some(last), Some(next)) => {
                        let s = (time - last.time) / (next.time - last.time);
                        last.position.lerp(next.position, s * s * s * (10.0 + s * (6.0 * s - 15.0)))
                    }
                    (Some(only), None) => only.position,
                    (None, Some(only)) => only.position,
                    (None, None) => DVec3::ZERO,
                }
            }
        }
    }

    /// Whether it may change after a time.
    pub fn moves_after(&self, time: f64) -> bool {
        match self {
            HandTarget::At(_) => false,
            HandTarget::Along(waypoints) => waypoints.last().is_some_and(|last| last.time > time),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reach_is_smooth_and_rests_at_its_waypoints() {
        let at = |time: f64, x: f64| Waypoint { time, position: DVec3::new(x, 0.0, -x) };
        let target = HandTarget::Along(vec![at(0.5, 1.0), at(1.0, 3.0), at(1.2, 3.0)]);
        for (time, x) in [(0.0, 1.0), (0.5, 1.0), (0.75, 2.0), (1.0, 3.0), (1.1, 3.0), (9.0, 3.0)] {
            assert!((target.at(time) - DVec3::new(x, 0.0, -x)).length() < 1e-15, "{time}");
        }
        // Fastest in the middle, 15/8 of the mean speed.
        let speed = (target.at(0.7501).x - target.at(0.7499).x) / 0.0002;
        assert!((speed - 15.0 / 8.0 * 4.0).abs() < 1e-5);
        assert!(target.at(0.501).x - 1.0 < 1e-6);
        assert!(target.moves_after(1.1) && !target.moves_after(1.2));
    }
}
