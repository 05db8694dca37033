//! The moving tip, and what its device measures of it.

use std::collections::VecDeque;

use glam::DVec3;

use super::axis::{Axis, State};
use super::hand::Hand;

/// Time over which positions are differenced for the velocity, s: the default of Force Dimension's library.
pub const VELOCITY_WINDOW: f64 = 0.02;

/// Longest stretch over which the hand's wish moves evenly, s: a reach of 20 mm in 0.1 s is off by 0.1 micrometres.
const STRETCH: f64 = 0.25e-3;

/// Most writes that wait for their time, and most measurements within the window: of a loop at 50 kHz over 20 ms.
const MAX_STORED: usize = 1024;

/// A device's mechanics at its tip, the same along every axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// Apparent mass, kg.
    pub mass: f64,
    /// Viscous damping, N s/m.
    pub damping: f64,
    /// Coulomb's friction, N: against any motion, and what a tip at rest withstands.
    pub dry_friction: f64,
    /// Step of the measured position, m; zero for a continuous one.
    pub encoder_step: f64,
    /// Time after which a written force acts, s.
    pub delay: f64,
}

/// A force that has been written and when it acts.
#[derive(Clone, Copy, Debug)]
struct Pending {
    time: f64,
    force: DVec3,
}

/// What a device measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// In whole steps of the encoder, m.
    pub position: DVec3,
    /// Difference of the measured positions over [`VELOCITY_WINDOW`], m/s.
    pub velocity: DVec3,
}

/// A tip in motion. Its time begins when it is made, and it moves only by [`Tip::advance`]: the same calls give the same bits.
/// After it is made nothing allocates.
#[derive(Debug)]
pub struct Tip {
    mechanics: Mechanics,
    /// The hand that holds it, if any does. It takes on the velocity of the tip.
    pub hand: Option<Hand>,
    time: f64,
    axes: [State; 3],
    /// Acts now, N.
    force: DVec3,
    pending: VecDeque<Pending>,
    /// Latest measured positions and their times.
    measured: VecDeque<(f64, DVec3)>,
}

impl Tip {
    /// At rest at a place, m, without a force.
    pub fn new(mechanics: Mechanics, position: DVec3, hand: Option<Hand>) -> Self {
        Self {
            mechanics,
            hand,
            time: 0.0,
            axes: position.to_array().map(|position| State { position, velocity: 0.0 }),
            force: DVec3::ZERO,
            pending: VecDeque::with_capacity(MAX_STORED),
            measured: VecDeque::with_capacity(MAX_STORED),
        }
    }

    /// The same tip at a velocity, m/s.
    pub fn moving(mut self, velocity: DVec3) -> Self {
        self.axes.iter_mut().zip(velocity.to_array()).for_each(|(axis, velocity)| axis.velocity = velocity);
        self
    }

    /// Time since it was made, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Where it is, m.
    pub fn position(&self) -> DVec3 {
        DVec3::from_array(self.axes.map(|axis| axis.position))
    }

    /// How it moves, m/s.
    pub fn velocity(&self) -> DVec3 {
        DVec3::from_array(self.axes.map(|axis| axis.velocity))
    }

    /// Force of the device that acts now, N.
    pub fn force(&self) -> DVec3 {
        self.force
    }

    /// Writes a force, N: it acts after the delay, until another one does.
    pub fn write(&mut self, force: DVec3) {
        if self.pending.len() == MAX_STORED {
            // The oldest one early, rather than memory without bound.
            self.force = self.pending.pop_front().map_or(self.force, |oldest| oldest.force);
        }
        self.pending.push_back(Pending { time: self.time + self.mechanics.delay, force });
        self.apply_due_force();
    }

    /// Lets go at once of the force and of all that wait: motors that are switched off.
    pub fn motors_off(&mut self) {
        self.pending.clear();
        self.force = DVec3::ZERO;
    }

    /// Moves on by a time, s.
    pub fn advance(&mut self, seconds: f64) {
        let end = self.time + seconds;
        while self.time < end {
            self.apply_due_force();
            let mut until = self.pending.front().map_or(end, |next| next.time.min(end));
            if self.hand.as_ref().is_some_and(|hand| hand.target.moves_after(self.time)) {
                until = until.min(self.time + STRETCH);
            }
            self.move_until(until);
        }
        self.apply_due_force();
    }

    /// What the device measures now; to be asked once a tick, for its velocity is a difference of what it has measured
    /// before.
    pub fn measure(&mut self) -> Measurement {
        let step = self.mechanics.encoder_step;
        let position = self.position();
        let position = if step > 0.0 { (position / step).round() * step } else { position };
        // The last one before the window stays, so that a slow loop has one to differ from.
        while self.measured.len() == MAX_STORED
            || self.measured.get(1).is_some_and(|(time, _)| *time <= self.time - VELOCITY_WINDOW)
        {
            self.measured.pop_front();
        }
        let velocity = match self.measured.front() {
            Some((time, before)) if *time < self.time => (position - *before) / (self.time - time),
            _ => DVec3::ZERO,
        };
        self.measured.push_back((self.time, position));
        Measurement { position, velocity }
    }

    fn apply_due_force(&mut self) {
        while let Some(due) = self.pending.front().filter(|next| next.time <= self.time) {
            self.force = due.force;
            self.pending.pop_front();
        }
    }

    /// With the force of now, and the hand's wish moving evenly.
    fn move_until(&mut self, until: f64) {
        let seconds = until - self.time;
        let Mechanics { mass, damping, dry_friction, .. } = self.mechanics;
        let held = self.hand.as_ref().map(|hand| {
            let target = hand.target.at(self.time);
            (hand, target, (hand.target.at(until) - target) / seconds)
        });
        for (rank, state) in self.axes.iter_mut().enumerate() {
            let alone = Axis {
                mass,
                damping,
                stiffness: 0.0,
                friction: dry_friction,
                force: self.force[rank],
                target: 0.0,
                drift: 0.0,
            };
            let axis = held.map_or(alone, |(hand, target, drift)| Axis {
                mass: mass + hand.mass,
                damping: damping + hand.damping,
                stiffness: hand.stiffness,
                target: target[rank],
                drift: drift[rank],
                ..alone
            });
            *state = axis.advance(*state, seconds);
        }
        self.time = until;
    }
}

#[cfg(test)]
mod tests {
    use super::super::hand::{HandTarget, Waypoint};
    use super::*;

    const MECHANICS: Mechanics =
        Mechanics { mass: 0.1, damping: 0.5, dry_friction: 0.0, encoder_step: 0.0, delay: 0.0 };

    fn free_tip(delay: f64) -> Tip {
        Tip::new(Mechanics { damping: 0.0, delay, ..MECHANICS }, DVec3::ZERO, None)
    }

    #[test]
    fn a_force_acts_after_its_delay_and_until_the_next() {
        // 1 N for 1 ms moves 0.1 kg at 10 mm/s, at 0.7 ms or 2.3 ticks after it was written.
        for delay in [0.0, 0.7e-3, 2.3e-3] {
            let mut tip = free_tip(delay);
            tip.advance(1e-3);
            tip.write(DVec3::X);
            tip.advance(1e-3);
            tip.write(DVec3::ZERO);
            assert!((tip.velocity().x - 1e-2 * (1.0 - delay / 1e-3).max(0.0)).abs() < 1e-15, "{delay}");
            tip.advance(9e-3);
            assert!((tip.velocity().x - 1e-2).abs() < 1e-15);
            // To the middle of the push and then on.
            let way = 0.5 * 1e-2 * 1e-3 + 1e-2 * (9e-3 - delay);
            assert!((tip.position().x - way).abs() < 1e-15, "{delay} {}", tip.position().x);
        }
    }

    #[test]
    fn the_path_does_not_depend_on_how_time_is_divided() {
        let target = HandTarget::Along(vec![
            Waypoint { time: 0.01, position: DVec3::ZERO },
            Waypoint { time: 0.11, position: DVec3::new(0.02, -0.01, 0.005) },
        ]);
        let hand = Hand { mass: 0.1, damping: 4.0, stiffness: 300.0, target };
        let mechanics = Mechanics { dry_friction: 0.05, delay: 0.4e-3, ..MECHANICS };
        let end = |parts: usize| {
            let mut tip = Tip::new(mechanics, DVec3::ZERO, Some(hand.clone()));
            for tick in 0..150 {
                tip.write(DVec3::new(0.3, 0.2 * f64::from(tick % 7), -0.1));
                (0..parts).for_each(|_| tip.advance(1e-3 / parts as f64));
            }
            (tip.position(), tip.velocity())
        };
        let (whole, parted) = (end(1), end(8));
        // Within what a stretch bends of the hand's wish.
        assert!((whole.0 - parted.0).length() < 1e-7, "{}", (whole.0 - parted.0).length());
        assert!((whole.1 - parted.1).length() < 1e-5);
        assert_eq!(end(1), whole);
    }

    #[test]
    fn a_hand_at_rest_gives_way_by_the_force_over_its_stiffness() {
        let hand = Hand { mass: 0.1, damping: 4.0, stiffness: 200.0, target: HandTarget::At(DVec3::Y) };
        let mut tip = Tip::new(MECHANICS, DVec3::Y, Some(hand));
        tip.write(DVec3::Z);
        tip.advance(5.0);
        assert!((tip.position() - DVec3::new(0.0, 1.0, 5e-3)).length() < 1e-12);
        tip.motors_off();
        tip.advance(5.0);
        assert!((tip.position() - DVec3::Y).length() < 1e-12);
    }

    #[test]
    fn measured_positions_are_whole_steps_and_velocities_their_differences() {
        let step = 5e-5;
        let mut tip = Tip::new(Mechanics { damping: 0.0, encoder_step: step, ..MECHANICS }, DVec3::ZERO, None);
        tip.write(DVec3::X);
        tip.advance(0.01);
        tip.write(DVec3::ZERO);
        assert_eq!(tip.measure().velocity, DVec3::ZERO);
        for _ in 0..100 {
            tip.advance(1e-3);
            let Measurement { position, velocity } = tip.measure();
            assert!((position.x / step - (position.x / step).round()).abs() < 1e-9);
            assert!((position.x - tip.position().x).abs() <= 0.5 * step + 1e-12);
            // A step of the encoder over the time since the oldest measurement.
            let over = (tip.time() - 0.01).min(VELOCITY_WINDOW);
            assert!((velocity.x - tip.velocity().x).abs() <= step / over * (1.0 + 1e-9), "{}", velocity.x);
        }
        assert!((tip.measure().velocity.x - 0.1).abs() <= step / VELOCITY_WINDOW);
    }
}
