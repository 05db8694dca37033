//! Preparation of strain responses between the ticks of a run without a clock: a response arrives after a fixed number of ticks.

use std::collections::VecDeque;

use palpate_core::Result;

use crate::handoff::LoopHandle;
use crate::preparer::StrainPreparer;
use crate::strain::{PreparerEnd, StrainAnswer};

/// Ticks after which a strain response comes: about as many as the thread beside a running loop takes.
const PREPARATION_TICKS: usize = 16;

/// Strain responses between the ticks, handed over after a fixed number of them.
pub(crate) struct Preparation {
    end: PreparerEnd,
    strain: StrainPreparer,
    due: VecDeque<(usize, StrainAnswer)>,
}

impl Preparation {
    pub(crate) fn new(handle: &mut LoopHandle, strain: &StrainPreparer) -> Result<Self> {
        Ok(Self { end: handle.take_strain()?, strain: strain.clone(), due: VecDeque::new() })
    }

    pub(crate) fn hand_over(&mut self, tick: usize) {
        while self.due.front().is_some_and(|(when, _)| *when <= tick) {
            self.due.pop_front().into_iter().for_each(|(_, response)| self.end.send(response));
        }
    }

    pub(crate) fn prepare(&mut self, tick: usize) {
        while let Some(prepared) = self.end.prepare_one(&self.strain) {
            self.due.extend(prepared.map(|response| (tick + PREPARATION_TICKS, response)));
        }
    }
}
