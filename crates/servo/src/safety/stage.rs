//! Safety stage of one tool.

use glam::DVec3;
use palpate_devices::{DeviceFault, Reading, Wrench};

use super::passivity::{Port, PortBalance, PortEnergy};
use super::reading::ReadingCheck;
use super::vector::{LimitedVector, clamped};
use super::{FaultReason, SafetyLimits};

/// What a tick computed for one device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ComputedWrench {
    /// By the contact laws, before the limit of strain: the reference of the energy balance.
    pub law: Wrench,
    /// What that limit leaves of it.
    pub limited: Wrench,
}

impl From<Wrench> for ComputedWrench {
    /// Where strain is not limited.
    fn from(wrench: Wrench) -> Self {
        Self { law: wrench, limited: wrench }
    }
}

/// The stage's memory.
#[derive(Clone, Debug)]
pub struct SafetyStage {
    limits: SafetyLimits,
    /// Time since the start or the last reset, s.
    age: f64,
    force: LimitedVector,
    torque: LimitedVector,
    readings: ReadingCheck,
    port: Port,
    /// Whether bodies move, so that energy may come back from one that was let go.
    keeps_energy: bool,
    fault: Option<FaultReason>,
}

impl SafetyStage {
    /// A stage at the start of its ramp. A scene whose bodies move `keeps_energy` when it is let go.
    pub fn new(limits: SafetyLimits, keeps_energy: bool) -> Self {
        Self {
            limits,
            age: 0.0,
            force: LimitedVector::default(),
            torque: LimitedVector::default(),
            readings: ReadingCheck::default(),
            port: Port::default(),
            keeps_energy,
            fault: None,
        }
    }

    /// From now on in a scene whose bodies move, or that has none any more.
    pub(crate) fn keep_energy(&mut self, keeps_energy: bool) {
        self.keeps_energy = keeps_energy;
    }

    /// Energy at the device's port since the start.
    pub fn energy(&self) -> PortEnergy {
        self.port.energy()
    }

    /// Share of what the model has received at all ports together that hands have put in, after all stages have taken up what
    /// their devices said, and before any is applied.
    pub fn scene_share(stages: &mut [Self]) -> f64 {
        if !stages.iter().any(|stage| stage.port.is_in_contact()) {
            stages.iter_mut().for_each(|stage| *stage.port.contribution() = PortBalance::default());
        }
        stages.iter_mut().map(|stage| *stage.port.contribution()).sum::<PortBalance>().share()
    }

    /// The latched fault, if any.
    pub fn fault(&self) -> Option<FaultReason> {
        self.fault
    }

    /// Latches a fault; the first one stays.
    pub fn latch(&mut self, fault: FaultReason) {
        self.fault.get_or_insert(fault);
    }

    /// Clears the fault and ramps in anew.
    pub fn reset(&mut self) {
        self.port.close();
        *self = Self { port: self.port.clone(), ..Self::new(self.limits, self.keeps_energy) };
    }

    /// Takes up what a device said at `now_ns`; latches where it cannot be believed. `None` where it said nothing.
    pub fn accept_reading(
        &mut self,
        reading: Result<Reading, DeviceFault>,
        now_ns: u64,
        period: f64,
    ) -> Option<Reading> {
        let checked = reading.map_err(FaultReason::Device);
        let checked = checked.and_then(|reading| {
            self.readings.check(&reading, now_ns, period, &self.limits)?;
            self.port.follow(&reading, period);
            Ok(())
        });
        checked.unwrap_or_else(|fault| self.latch(fault));
        reading.ok()
    }

    /// The wrench to put out for `computed`, `period` seconds after the last call; the share is that of
    /// [`SafetyStage::scene_share`], one for a stage by itself.
    pub fn apply(&mut self, computed: impl Into<ComputedWrench>, scene_share: f64, period: f64) -> Wrench {
        let ComputedWrench { law, limited } = computed.into();
        self.age += period;
        // The magnitude of a finite vector may overflow.
        if ![law, limited].iter().all(|wrench| wrench.force.length().is_finite() && wrench.torque.length().is_finite())
        {
            self.latch(FaultReason::WrenchNotFinite);
        }
        if self.fault.is_some() {
            self.force.reset();
            self.torque.reset();
            self.port.close();
            return Wrench::default();
        }
        let limits = &self.limits;
        let share = if self.age < limits.ramp { self.age / limits.ramp } else { 1.0 };
        let asked = Wrench {
            force: clamped(limited.force, share, limits.max_force),
            torque: clamped(limited.torque, share, limits.max_torque),
        };
        let damping = self.port.damping(&law, &asked, limits, scene_share, period);
        // A difference of nothing changes no bit, and does not pass the clamp again.
        let damped = |asked: DVec3, damping: DVec3, most: f64| match damping == DVec3::ZERO {
            true => asked,
            false => clamped(asked - damping, 1.0, most),
        };
        let out = Wrench {
            force: self.force.pass(damped(asked.force, damping.force, limits.max_force), limits.max_slew * period),
            torque: self
                .torque
                .pass(damped(asked.torque, damping.torque, limits.max_torque), limits.max_torque_slew * period),
        };
        self.port.record(law, out, self.keeps_energy);
        out
    }
}

#[cfg(test)]
mod tests {
    use palpate_devices::{Pose, Twist};

    use super::*;

    const PERIOD: f64 = 1e-3;
    const PERIOD_NS: u64 = 1_000_000;

    fn force(force: DVec3) -> Wrench {
        Wrench { force, ..Wrench::default() }
    }

    fn torque(torque: DVec3) -> Wrench {
        Wrench { torque, ..Wrench::default() }
    }

    fn settled(limits: SafetyLimits) -> SafetyStage {
        let mut stage = SafetyStage::new(limits, false);
        (0..1000).for_each(|_| _ = stage.apply(Wrench::default(), 1.0, PERIOD));
        stage
    }

    /// A reading of a tip moving along x, measured by a clock that is 7 s ahead.
    fn reading(x: f64, measured_ns: u64) -> Reading {
        let pose = Pose::at(DVec3::new(x, 0.0, 0.0));
        Reading { pose, active: true, timestamp_ns: measured_ns + 7_000_000_000, ..Reading::default() }
    }

    #[test]
    fn ramps_in_at_the_start_and_after_a_reset() {
        let limits = SafetyLimits { max_slew: 1e9, ..SafetyLimits::default() };
        let mut stage = SafetyStage::new(limits, false);
        for _ in 0..2 {
            let out: Vec<f64> = (0..300).map(|_| stage.apply(force(DVec3::X), 1.0, PERIOD).force.x).collect();
            assert!((out[124] - 0.5).abs() < 1e-9);
            assert_eq!(out[299], 1.0);
            stage.reset();
        }
    }

    #[test]
    fn forces_and_torques_are_limited_each_by_its_own() {
        let limits = SafetyLimits { max_torque: 0.2, max_torque_slew: 10.0, ..SafetyLimits::default() };
        let mut stage = settled(limits);
        let computed = Wrench { force: 20.0 * DVec3::X, torque: -DVec3::Y };
        for tick in 1..40 {
            let (out, t) = (stage.apply(computed, 1.0, PERIOD), f64::from(tick) * PERIOD);
            assert!((out.force - DVec3::X * (500.0 * t).min(8.0)).length() < 1e-12);
            assert!((out.torque + DVec3::Y * (10.0 * t).min(0.2)).length() < 1e-12);
        }
        assert_eq!(stage.apply(Wrench::default(), 1.0, PERIOD), Wrench::default(), "letting go is never slowed down");
    }

    #[test]
    fn a_wrench_that_is_not_finite_latches_until_reset() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200] {
            for wrench in [force(DVec3::new(0.0, bad, 0.0)), torque(DVec3::new(0.0, 0.0, bad))] {
                let mut stage = settled(SafetyLimits::default());
                assert_eq!(stage.apply(wrench, 1.0, PERIOD), Wrench::default());
                assert_eq!(stage.apply(force(DVec3::X), 1.0, PERIOD), Wrench::default());
                assert_eq!(stage.fault(), Some(FaultReason::WrenchNotFinite));
                stage.reset();
                assert!(stage.apply(force(DVec3::X), 1.0, PERIOD).force.x > 0.0);
            }
        }
    }

    /// Ticks through what a device says, by its tick; the fault and the tick at which it latched.
    fn admitted(reading: impl Fn(u64) -> Result<Reading, DeviceFault>, ticks: u64) -> Option<(u64, FaultReason)> {
        let mut stage = settled(SafetyLimits::default());
        (0..ticks).find_map(|tick| {
            stage.accept_reading(reading(tick), tick * PERIOD_NS, PERIOD);
            stage.fault().map(|fault| (tick, fault))
        })
    }

    #[test]
    fn input_that_stops_is_stale_after_its_time() {
        // The last measurement is seen at 100 ms; 50 ms later it is still good, 51 ms later not.
        let stops = |tick: u64| Ok(reading(0.0, tick.min(100) * PERIOD_NS));
        assert_eq!(admitted(stops, 300), Some((151, FaultReason::StaleInput)));
        // A device slower than the loop is not stale, and one out of the scene has nothing to say.
        assert_eq!(admitted(|tick| Ok(reading(0.0, tick / 10 * 10 * PERIOD_NS)), 300), None);
        assert_eq!(admitted(|tick| Ok(Reading { active: tick < 100, ..reading(0.0, 0) }), 40), None);
        assert_eq!(admitted(|tick| Ok(Reading { active: tick > 200, ..reading(0.0, 0) }), 250), None);
    }

    #[test]
    fn input_that_jumps_latches() {
        let path = |speed: f64| move |tick: u64| Ok(reading(speed * PERIOD * tick as f64, tick * PERIOD_NS));
        assert_eq!(admitted(path(9.9), 100), None);
        assert_eq!(admitted(path(10.1), 100), Some((1, FaultReason::JumpingInput)));
        // Every fifth tick a measurement: 40 mm in 5 ms are 8 m/s.
        let slow = |tick: u64| Ok(reading(0.04 * (tick / 5) as f64, tick / 5 * 5 * PERIOD_NS));
        assert_eq!(admitted(slow, 100), None);
        // A tool that comes into the scene may come in anywhere.
        let comes = |tick: u64| Ok(Reading { active: tick != 50, ..reading((tick / 50) as f64, tick * PERIOD_NS) });
        assert_eq!(admitted(comes, 99), None);
        assert_eq!(admitted(comes, 200), Some((100, FaultReason::JumpingInput)));
    }

    #[test]
    fn bad_numbers_and_faults_of_the_device_latch() {
        let good = reading(0.0, 0);
        let (mut position, mut orientation) = (good.pose, good.pose);
        (position.position.y, orientation.orientation.w) = (f64::NAN, f64::INFINITY);
        let twist = Twist { angular: DVec3::NAN, ..Twist::default() };
        for bad in
            [Reading { pose: position, ..good }, Reading { pose: orientation, ..good }, Reading { twist, ..good }]
        {
            assert_eq!(admitted(|_| Ok(bad), 10), Some((0, FaultReason::ReadingNotFinite)));
            assert_eq!(admitted(|_| Ok(Reading { active: false, ..bad }), 10), None);
        }
        let fault = DeviceFault::Driver(-7);
        assert_eq!(admitted(|_| Err(fault), 10), Some((0, FaultReason::Device(fault))));
    }

    #[test]
    fn the_first_fault_stays() {
        let mut stage = settled(SafetyLimits::default());
        stage.latch(FaultReason::StaleInput);
        stage.apply(force(DVec3::NAN), 1.0, PERIOD);
        assert_eq!(stage.fault(), Some(FaultReason::StaleInput));
    }
}
