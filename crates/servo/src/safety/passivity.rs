//! Observer and controller of the energy that devices give to hands.
//!
//! **What is balanced.** At tick `k` the model computes a wrench `c_k`, and `o_k` goes out. What the stage withholds is
//! `w_k = c_k - o_k`. With the tip's displacement `dx_k` and rotation since the tick before, by the trapezoid rule,
//!
//! ```text
//! received_k = received_(k-1) - (c_(k-1) + c_k) . dx_k / 2      what the model has from the hand, as it computes
//! owed_k     = owed_(k-1)     - (w_(k-1) + w_k) . dx_k / 2      what of that the hand has not put in
//! paid       = received - owed                                  what the hand has put in
//! ```
//!
//! The reference is the model's own port, not a zero of energy: a body that was struck, that swings, or whose stiffness a
//! slider has changed, gives energy that is not the hand's, and it comes through `c`. Whether the model itself is
//! passive is the contact laws' affair, and so is their error of the trapezoid rule: both wrenches go through the same sum.
//! `owed` holds only what the stage makes of it. A stage that withholds nothing owes nothing, to the bit.
//!
//! The ramp after the start and the limit of slew withhold force while a hand presses, and let all of it out when it has
//! stopped: the model stores `received`, the hand has put in less, and gets back everything on lifting. That is the error to
//! be paid. A clamp owes while it is reached and has that back by itself; nothing must be done about it.
//!
//! **Control.** The hand gets back the share that it has put in. With `share = paid / received`, in [0, 1], and the velocity
//! `v` of the tip, the power of the wrench that goes out is to be
//!
//! ```text
//! o . v = share c . v      while the model gives energy (c . v > 0)
//! ```
//!
//! Along it `owed : received` stays as it is, so both end at zero together, wherever the path goes: with
//! `w = (1 - share) c` it is `d owed = (1 - share) d received`. The difference is taken out as damping, a force
//! against the velocity. The rule is exact for the trapezoid rule too where the share is taken after the first half of
//! a tick's motion is booked, under the wrenches of the tick before: `owed = (1 - share) received` then holds before and after
//! the other half. For a clamped spring whose force grows with depth `share c` is never below the clamp, so that this does
//! nothing. What the hand has got beyond that (`overdraft`) is paid by damping in any motion, within
//! [`PAYMENT_TICKS`] of it; never faster, for the trapezoid rule pays half of a tick later, and what is taken too
//! early alternates.
//!
//! The damping is bounded: `b <= max_damping` of the device, for a stronger one oscillates, so that what is held at rest is
//! never changed; and the whole wrench passes clamp and slew as any other. So the wrench put out may, by this damping
//! alone, be more than computed, or against it: it then opposes the motion, and takes energy out. What cannot be paid within
//! those bounds stays owed, and is reported ([`PortEnergy`]).
//!
//! **When a contact ends** (`c = 0`) a scene at rest holds nothing any more: what it had received and not given back is
//! lost, what is owed beyond it is overdraft. Where bodies move, energy may come back later, and all that is owed stays. A
//! credit, `owed < 0`, is forgotten: else what one contact took out would hide what the next one makes.
//!
//! **Ports of one body.** What one hand presses into a body may come out at another. By its own account the other then gives
//! energy that it has not received (`received <= 0`), of which nothing is owed, and the first ends with what it owed
//! forgotten, as if its body had lost it: with a start ramp two hands get back 0.2 to 0.5 % of the peak. So the ports are
//! balanced together too. With sums over the ports the energy of the body is one, the hands have paid
//! `sum received - sum owed` of it, and every port gives back no more than the share of that,
//!
//! ```text
//! o_i . v_i = min(share_i, share) c_i . v_i        share = 1 - sum owed / sum received
//! ```
//!
//! Where a port presses, both sums grow by its own, `d owed <= d received`. Where one gives,
//! `d owed_i <= (1 - share) d received_i`. Both keep `0 <= sum owed <= sum received`, whichever port gives what another has
//! taken, so that the sums end at zero together. All first halves of a tick are booked before any share is taken. The sums
//! begin anew when no port is in contact. They run over all tools of a scene: bodies apart from each other exchange nothing,
//! and a hand may then be damped for what another owes. Sums for each body would need to know what part of a withheld force
//! belongs to which body, where a tool touches two.
//!
//! Source: Hannaford and Ryu, Time-domain passivity control of haptic interfaces (IEEE Trans. Robotics and Automation 18,
//! 2002), whose observer takes the port's energy from zero and whose controller acts when it turns negative: the whole
//! force then falls to zero on the way up. Paying by share spreads the same energy over the lift.
//!
//! Not in it: a device holds a force for a tick while the tip moves on, which gives out `K T v^2 / 2` of power for a spring
//! `K`. The device's own damping must take that (Colgate and Schenkel 1997): `DeviceLimits::largest_stiffness`.

use std::iter::Sum;

use glam::DVec3;
use palpate_devices::{Pose, Reading, Wrench};

use super::SafetyLimits;

/// Motion of a tick over which an overdraft is paid, if the bound of damping allows: several, see the module's header.
const PAYMENT_TICKS: f64 = 8.0;

/// What may be owed for ever, J: a hundredth of a newton over a tenth of a micrometre.
const TOLERANCE: f64 = 1e-9;

/// Energy at the port of one device since the start, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PortEnergy {
    /// Net energy given to the hand; negative while a contact stores what the hand has put in.
    pub given: f64,
    /// What the hand has got, or will get if the model gives all it stores, beyond what it put in and what the model gave.
    pub owed: f64,
    /// What was owed at faults and resets, and when the tool left the scene, in sum: it was never paid.
    pub unpaid: f64,
}

/// A rotation and a displacement, or their rates.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// m, or m/s.
    linear: DVec3,
    /// rad, or rad/s.
    angular: DVec3,
}

impl Motion {
    fn between(before: &Pose, now: &Pose) -> Self {
        let angular = now.rotation_from(before);
        Self { linear: now.position - before.position, angular }
    }

    fn over(self, seconds: f64) -> Self {
        Self { linear: self.linear / seconds, angular: self.angular / seconds }
    }
}

/// Latest measurement of the tip.
#[derive(Clone, Copy, Debug)]
struct Measurement {
    pose: Pose,
    timestamp_ns: u64,
}

/// What a model has received at a port, or at several, and what of it hands have not put in, J.
#[derive(Clone, Copy, Debug, Default)]
pub struct PortBalance {
    received: f64,
    owed: f64,
}

impl PortBalance {
    /// Part of what the model has received that hands have put in.
    pub fn share(&self) -> f64 {
        let owes = self.owed > TOLERANCE && self.received > 0.0;
        if owes { (1.0 - self.owed / self.received).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// What hands have got beyond what they put in and what the model gave, J.
    fn overdraft(&self) -> f64 {
        (self.owed - self.received.max(0.0)).max(0.0)
    }

    fn add(&mut self, received: f64, owed: f64) {
        self.received += received;
        self.owed += owed;
    }
}

impl Sum for PortBalance {
    fn sum<I: Iterator<Item = Self>>(balances: I) -> Self {
        balances.fold(Self::default(), |mut sum, balance| {
            sum.add(balance.received, balance.owed);
            sum
        })
    }
}

/// The balance of one device's port.
#[derive(Clone, Debug, Default)]
pub struct Port {
    latest: Option<Measurement>,
    /// Time since the latest measurement, s.
    elapsed: f64,
    /// Since the tick before.
    moved: Motion,
    /// Between the two latest measurements: a device slower than the loop has none in some ticks.
    velocity: Motion,
    /// Computed and withheld at the tick before.
    computed: Wrench,
    withheld: Wrench,
    /// Of the contact.
    balance: PortBalance,
    /// Of all contacts since the ports of the scene were last without any.
    contribution: PortBalance,
    /// What has been given, and what never paid, J.
    given: f64,
    unpaid: f64,
}

impl Port {
    /// Energies so far.
    pub fn energy(&self) -> PortEnergy {
        PortEnergy { given: self.given, owed: self.balance.owed, unpaid: self.unpaid }
    }

    /// Part in the balance of all ports of the scene; zero once there is no port in contact.
    pub fn contribution(&mut self) -> &mut PortBalance {
        &mut self.contribution
    }

    /// Whether the model computed a wrench at the last tick.
    pub fn is_in_contact(&self) -> bool {
        self.computed != Wrench::default()
    }

    /// Follows the tip, `period` seconds after the last call. A tool out of the scene has no port.
    pub fn follow(&mut self, reading: &Reading, period: f64) {
        if !reading.active {
            return self.close();
        }
        let now = Measurement { pose: reading.pose, timestamp_ns: reading.timestamp_ns };
        self.elapsed += period;
        match self.latest {
            None => (self.moved, self.velocity) = Default::default(),
            Some(before) if before.timestamp_ns == now.timestamp_ns && before.pose == now.pose => {
                self.moved = Motion::default();
                return;
            }
            Some(before) => {
                self.moved = Motion::between(&before.pose, &now.pose);
                // By ticks, not by the device's clock: live and offline runs give the same bits.
                self.velocity = self.moved.over(self.elapsed);
                self.record_half(self.computed, self.withheld);
            }
        }
        (self.latest, self.elapsed) = (Some(now), 0.0);
    }

    /// Ends the balance: no wrench goes out, or nobody knows where the tip is. What is owed then stays unpaid.
    pub fn close(&mut self) {
        let unpaid = self.unpaid + self.balance.overdraft();
        *self = Self { given: self.given, unpaid, ..Self::default() };
    }

    /// Damping of this tick, to be taken from what is asked for: `computed`, ramped and clamped, is `asked`. `scene_share` is
    /// the share of all ports together.
    pub fn damping(
        &self,
        computed: &Wrench,
        asked: &Wrench,
        limits: &SafetyLimits,
        scene_share: f64,
        period: f64,
    ) -> Wrench {
        if self.balance.owed <= TOLERANCE && scene_share >= 1.0 {
            return Wrench::default();
        }
        let Motion { linear, angular } = self.velocity;
        let bounds = [limits.max_damping * linear.length(), limits.max_angular_damping * angular.length()];
        // Power that the bounds allow, and the part of it that pays the overdraft in time.
        let most = bounds[0] * linear.length() + bounds[1] * angular.length();
        let wanted = self.balance.overdraft() / (PAYMENT_TICKS * period);
        let part = if wanted < most { wanted / most } else { 1.0 };
        let part = if wanted > 0.0 { part } else { 0.0 };
        let share = self.balance.share().min(scene_share);
        Wrench {
            force: damping_against(linear, computed.force, asked.force, share, part, bounds[0]),
            torque: damping_against(angular, computed.torque, asked.torque, share, part, bounds[1]),
        }
    }

    /// Books the tick: `computed` by the model, `out` to the device. A scene whose bodies move `keeps_energy` when it is let
    /// go.
    pub fn record(&mut self, computed: Wrench, out: Wrench, keeps_energy: bool) {
        let withheld = Wrench { force: computed.force - out.force, torque: computed.torque - out.torque };
        self.record_half(computed, withheld);
        (self.computed, self.withheld) = (computed, withheld);
        if computed == Wrench::default() {
            let left = if keeps_energy { self.balance.owed.max(0.0) } else { self.balance.overdraft() };
            self.balance = PortBalance { received: 0.0, owed: if left > TOLERANCE { left } else { 0.0 } };
        }
        self.moved = Motion::default();
    }

    /// Books half of the motion under a wrench at one end of it: that of the tick before as soon as the motion is known, so
    /// that the share is exact, see the module's header; that of this tick when it has gone out.
    fn record_half(&mut self, computed: Wrench, withheld: Wrench) {
        let received = -0.5 * work(&computed, &self.moved);
        let owed = -0.5 * work(&withheld, &self.moved);
        self.balance.add(received, owed);
        self.contribution.add(received, owed);
        self.given += owed - received;
    }
}

/// Work of a wrench over a motion, J.
fn work(wrench: &Wrench, moved: &Motion) -> f64 {
    wrench.force.dot(moved.linear) + wrench.torque.dot(moved.angular)
}

/// Damping against a velocity, at most `bound`: what is asked beyond the share of what is computed, and a `part` of the bound.
fn damping_against(velocity: DVec3, computed: DVec3, asked: DVec3, share: f64, part: f64, bound: f64) -> DVec3 {
    let Some(direction) = velocity.try_normalize() else { return DVec3::ZERO };
    let due = share * computed.dot(direction).max(0.0);
    let beyond = (asked.dot(direction) - due).max(0.0);
    direction * (beyond + part * bound).min(bound)
}
