//! The stage of one tool.

use palpate_devices::{DeviceFault, Reading, Wrench};

use super::reading::ReadingCheck;
use super::vector::LimitedVector;
use super::{FaultReason, SafetyLimits};

/// The stage's memory.
#[derive(Clone, Debug)]
pub struct SafetyStage {
    limits: SafetyLimits,
    /// Time since the start or the last reset, s.
    age: f64,
    force: LimitedVector,
    torque: LimitedVector,
    readings: ReadingCheck,
    fault: Option<FaultReason>,
}

impl SafetyStage {
    /// A stage at the start of its ramp.
    pub fn new(limits: SafetyLimits) -> Self {
        Self {
            limits,
            age: 0.0,
            force: LimitedVector::default(),
            torque: LimitedVector::default(),
            readings: ReadingCheck::default(),
            fault: None,
        }
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
        *self = Self::new(self.limits);
    }

    /// Takes up what a device said at `now_ns`; latches where it cannot be believed. `None` where it said nothing.
    pub fn admit(&mut self, said: Result<Reading, DeviceFault>, now_ns: u64, period: f64) -> Option<Reading> {
        let checked = said.map_err(FaultReason::Device);
        let checked = checked.and_then(|reading| self.readings.check(&reading, now_ns, period, &self.limits));
        checked.unwrap_or_else(|fault| self.latch(fault));
        said.ok()
    }

    /// The wrench to put out for `computed`, `period` seconds after the last call.
    pub fn apply(&mut self, computed: Wrench, period: f64) -> Wrench {
        self.age += period;
        // The magnitude of a finite vector may overflow.
        if !(computed.force.length().is_finite() && computed.torque.length().is_finite()) {
            self.latch(FaultReason::WrenchNotFinite);
        }
        if self.fault.is_some() {
            self.force.reset();
            self.torque.reset();
            return Wrench::default();
        }
        let limits = &self.limits;
        let share = if self.age < limits.ramp { self.age / limits.ramp } else { 1.0 };
        Wrench {
            force: self.force.pass(computed.force, share, limits.max_force, limits.max_slew * period),
            torque: self.torque.pass(computed.torque, share, limits.max_torque, limits.max_torque_slew * period),
        }
    }
}
