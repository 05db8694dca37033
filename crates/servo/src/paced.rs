//! A loop without threads, for a host that wakes late and may not wait: at each wake it makes the ticks that have come due.
//!
//! A browser wakes a worker every 4 ms at best. Each tick is that of its own deadline on the grid, so that time in the scene
//! goes on evenly; what is further behind than a host may catch up with is left out and counted. Strain responses are prepared
//! between the ticks.

use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::Model;
use palpate_devices::Device;

use crate::force_loop::ForceLoop;
use crate::handoff::LoopHandle;
use crate::preparer::StrainPreparer;
use crate::safety::SafetyLimits;
use crate::settings::Settings;
use crate::strain::PreparerEnd;

/// Time that one wake makes up for, s: a page that was hidden for longer goes on from there.
const LONGEST_LAG: f64 = 0.1;

/// A force loop, the ends of its hand-offs, and its deadlines.
pub struct PacedLoop {
    force_loop: ForceLoop,
    /// Where settings go in and ticks are read.
    pub handle: LoopHandle,
    end: PreparerEnd,
    strain: StrainPreparer,
    period: f64,
    deadline_ns: Option<u64>,
    missed: u64,
}

impl PacedLoop {
    /// Around a loop with one device a tool and a time `period` between two ticks, s.
    ///
    /// # Errors
    /// See [`ForceLoop::new`].
    pub fn new(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
        strain: StrainPreparer,
        period: f64,
    ) -> Result<Self> {
        let (mut force_loop, mut handle) = ForceLoop::new(model, devices, limits, settings)?;
        force_loop.check_period(period)?;
        force_loop.limit_strain_of(strain.limitable());
        let end = handle.take_strain()?;
        Ok(Self { force_loop, handle, end, strain, period, deadline_ns: None, missed: 0 })
    }

    /// Makes the ticks that are due at `now_ns`, the first at its first call; how many. `each` is called after each.
    pub fn advance(&mut self, now_ns: u64, mut each: impl FnMut(&mut LoopHandle)) -> u64 {
        let period_ns = (1e9 * self.period).round() as u64;
        let mut deadline = *self.deadline_ns.get_or_insert(now_ns);
        let behind = now_ns.saturating_sub(deadline) / period_ns;
        let most = (LONGEST_LAG / self.period) as u64;
        if behind > most {
            self.missed += behind - most;
            deadline += (behind - most) * period_ns;
        }
        let mut ticks = 0;
        while deadline <= now_ns {
            self.force_loop.tick(deadline, self.period);
            each(&mut self.handle);
            deadline += period_ns;
            ticks += 1;
        }
        self.deadline_ns = Some(deadline);
        if let Some(Some(answer)) = self.end.prepare_one(&self.strain) {
            self.end.send(answer);
        }
        ticks
    }

    /// Ticks that were left out because the host woke too late.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}
