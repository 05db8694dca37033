//! One tick, the same for the servo's thread, a driver's callback and an offline run.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use palpate_core::Result;
use palpate_core::memory::Ranges;
use palpate_core::simulation::{
    Input, MAX_BODIES, MAX_TOOLS, Model, Output, PreviousRanks, Scratch, State, ToolInput, step,
};
use palpate_devices::{Device, DeviceLimits, Wrench};

use crate::change::{AcceptedOffer, ChangeEnd, ChangeHandle, change_ends};
use crate::clock;
use crate::handoff::{LOG_ROWS, LoopEnds, LoopHandle, handoffs};
use crate::log::{LogRow, RealtimeStatus, Status};
use crate::preparer::{StrainPreparer, StrainWorker};
use crate::record::{RecordedInput, RecordedTool, StrainArrivals, recorded_port};
use crate::safety::{ComputedWrench, Fault, FaultReason, SafetyLimits, SafetyStage, check_stiffness};
use crate::settings::{Settings, refuse_unless};
use crate::timing::{Clock, Timing};

/// A simulation with its devices, safety stages and hand-offs, ready to tick.
///
/// Whoever owns it ticks it: one thread at a time, and any thread. It may move from one to another between ticks.
pub struct ForceLoop {
    model: Arc<Model>,
    state: State,
    scratch: Scratch,
    devices: Vec<Box<dyn Device>>,
    limits: SafetyLimits,
    stages: Vec<SafetyStage>,
    /// A fault of the whole loop.
    fault: Option<FaultReason>,
    ends: LoopEnds,
    /// Hand-over of another scene, and its other end until it is taken.
    changes: ChangeEnd<Successor>,
    change_handle: Option<ChangeHandle<Successor>>,
    settings: Settings,
    timing: Timing,
    status: Status,
    /// Of which bodies the strain can be limited.
    limited: [bool; MAX_BODIES],
    /// Time of the first tick, ns.
    start_ns: Option<u64>,
    /// Row of the last tick: how long it took is known when it is over.
    row: Option<LogRow>,
    /// Bodies whose requests for strain find no room in a tick that is made again.
    skipped: u32,
}

impl ForceLoop {
    /// The memory that its ticks read.
    pub(crate) fn memory(&self) -> Ranges {
        self.model.memory()
    }

    /// At rest, at the start of the safety ramp, with one device a tool of the model and in their order.
    ///
    /// # Errors
    /// More or fewer devices than tools, limits or settings that are out of range, a tool stiffer than its device holds.
    pub fn new(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
    ) -> Result<(Self, LoopHandle)> {
        Self::with_clock(model, devices, limits, settings, (clock::now_ns, LOG_ROWS))
    }

    /// For ticks without a clock, with room for so many rows of the log; what prepares strain responses between them has yet to
    /// be taken from the handle.
    pub(crate) fn without_clock(
        model: &Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
        strain: &StrainPreparer,
        log_rows: usize,
    ) -> Result<(Self, LoopHandle)> {
        let (mut force_loop, handle) = Self::with_clock(model.clone(), devices, limits, settings, (|| 0, log_rows))?;
        force_loop.limit_strain_of(strain.limitable());
        Ok((force_loop, handle))
    }

    /// With a clock to measure ticks by, and room for so many rows of the log.
    fn with_clock(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
        (clock, log_rows): (Clock, usize),
    ) -> Result<(Self, LoopHandle)> {
        let (tools, given) = (model.tools.len(), devices.len());
        refuse_unless(tools == given, || format!("a scene of {tools} tools takes as many devices, got {given}"))?;
        limits.check()?;
        settings.check(&model)?;
        let moves = model.bodies.iter().any(|body| body.moves());
        let mut stages = Vec::new();
        for (tool, device) in devices.iter().enumerate() {
            stages.push(SafetyStage::new(limits.with_device(&model, tool, &device.limits())?, moves));
        }
        let (changes, change_handle) = change_ends();
        let (ends, handle) = handoffs(&model, &settings, &stages, log_rows);
        let (state, scratch) = (State::new(&model), Scratch::new(&model));
        let force_loop = Self {
            model,
            state,
            scratch,
            devices,
            limits,
            stages,
            fault: None,
            ends,
            changes,
            change_handle: Some(change_handle),
            settings,
            timing: Timing::new(clock),
            status: Status::default(),
            limited: [false; MAX_BODIES],
            start_ns: None,
            row: None,
            skipped: 0,
        };
        Ok((force_loop, handle))
    }

    /// Reads the devices, steps, makes safe and writes the devices; then accounts and publishes.
    ///
    /// `now_ns` is the time for which the tick is due by the monotonic clock ([`crate::now_ns`]), ns: its deadline, or in a
    /// driver's callback the time of the call. `period` is the time between two ticks, s. Never allocates, locks or blocks,
    /// and never panics: a panic within becomes a latched fault.
    pub fn tick(&mut self, now_ns: u64, period: f64) {
        if self.fault == Some(FaultReason::Panic) {
            // Nothing is taken up any more, and nobody is to find the ring full.
            self.ends.commands.remap(&PreviousRanks::default());
            return self.release();
        }
        if catch_unwind(AssertUnwindSafe(|| self.guarded_tick(now_ns, period))).is_err() {
            self.latch(FaultReason::Panic);
            self.release();
        }
    }

    /// Latches a fault of the whole loop: no wrench on any device until a reset. The first one stays, unless the new one
    /// outlasts resets.
    pub fn latch(&mut self, reason: FaultReason) {
        if self.fault.is_none() || reason.outlasts_reset() {
            self.fault = Some(reason);
        }
    }

    /// The fault that keeps wrenches at zero: that of the whole loop, or the first tool's that has one.
    pub fn fault(&self) -> Option<Fault> {
        fault(self.fault, &self.stages)
    }

    /// Limits the strain of the bodies that `preparer` can measure, by a thread beside the loop that prepares what each
    /// contact needs; to be kept as long as the loop ticks.
    ///
    /// # Errors
    /// A loop whose strain is limited already; no thread from the operating system.
    pub fn limit_strain(&mut self, handle: &mut LoopHandle, preparer: StrainPreparer) -> Result<StrainWorker> {
        self.limited = preparer.limitable();
        StrainWorker::start(handle.take_strain()?, preparer)
    }

    /// Limits the strain of bodies for which somebody else prepares responses.
    pub(crate) fn limit_strain_of(&mut self, bodies: [bool; MAX_BODIES]) {
        self.limited = bodies;
    }

    /// Whether the devices can be ticked with a time `period` between two ticks, s. Whoever calls [`ForceLoop::tick`] from a
    /// driver's callback asks with the callback's.
    ///
    /// # Errors
    /// A device that takes fewer wrenches a second, or whose own damping is too weak for the tool's largest stiffness at that
    /// rate: see `DeviceLimits::largest_stiffness`.
    pub fn check_period(&self, period: f64) -> Result<()> {
        let limits: Vec<_> = self.devices.iter().map(|device| device.limits()).collect();
        check_period(&self.model, &limits, period)
    }

    /// Readies a tick that is made again for what did not follow from its input: faults by timing or of drivers, and requests
    /// that found no room.
    pub(crate) fn prepare_replay(&mut self, input: &RecordedInput) {
        self.fault = input.fault;
        for (stage, fault) in self.stages.iter_mut().zip(input.tool_faults) {
            fault.into_iter().for_each(|fault| stage.latch(fault));
        }
        self.skipped = input.strain.unsent;
    }

    /// Wrench on the device of a tool in the last tick, before the safety stage.
    pub(crate) fn computed(&mut self, tool: usize) -> ComputedWrench {
        self.ends.recorder.tool(tool).computed
    }

    /// Its state after the last tick.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// The end through which another scene comes in.
    pub(crate) fn take_change_handle(&mut self) -> Option<ChangeHandle<Successor>> {
        self.change_handle.take()
    }

    pub(crate) fn set_realtime(&mut self, realtime: RealtimeStatus) {
        self.status.realtime = realtime;
    }

    fn guarded_tick(&mut self, now_ns: u64, period: f64) {
        self.timing.begin(now_ns);
        let changed = self.take_change();
        self.begin_record(now_ns, period);
        let mut input = self.receive(period);
        self.read_devices(&mut input, now_ns, period);
        let output = step(&self.model, &mut self.state, &mut self.scratch, &input);
        self.write_devices(&output, period);
        self.request_strain(&input);
        self.account(now_ns, &output);
        self.publish();
        // Not before: a thread that waits for it reads what was published.
        changed.into_iter().for_each(|taken| self.changes.give_back(taken));
        let (took_ns, overrun) = self.timing.end(period, &self.limits, &mut self.status);
        if let Some(row) = &mut self.row {
            row.compute_us = 1e-3 * took_ns as f64;
        }
        self.ends.recorder.end_tick(&self.model, &self.state, self.timing.delay_ns(), took_ns);
        overrun.into_iter().for_each(|reason| self.latch(reason));
    }

    /// Continues as the successor loop, if there is one, and returns the replaced one. Never allocates or frees.
    fn take_change(&mut self) -> Option<AcceptedOffer<Successor>> {
        let mut taken = self.changes.take()?;
        let Successor { force_loop, previous_ranks, keeps_device } = taken.item();
        force_loop.continue_from(self, previous_ranks, keeps_device);
        std::mem::swap(self, force_loop);
        // Whoever waits does so at the ends of the loop that was there first.
        std::mem::swap(&mut self.changes, &mut force_loop.changes);
        Some(taken)
    }

    /// Takes contacts, devices and hand-offs over from the previous loop. Devices that leave get no wrench.
    fn continue_from(&mut self, before: &mut ForceLoop, previous_ranks: &PreviousRanks, keeps_device: &[bool]) {
        // A tool with another device is another hand at another place: what it held is let go of.
        let mut previous_ranks = *previous_ranks;
        for (tool, keeps) in previous_ranks.tools.iter_mut().zip(keeps_device) {
            *tool = tool.filter(|&old| *keeps && old < before.devices.len());
        }
        let previous_ranks = &previous_ranks;
        self.state.take_over(&mut before.state, previous_ranks, &self.model);
        let moves = self.model.bodies.iter().any(|body| body.moves());
        for (tool, old) in previous_ranks.tools.iter().enumerate() {
            let Some(old) = *old else { continue };
            std::mem::swap(&mut self.devices[tool], &mut before.devices[old]);
            std::mem::swap(&mut self.stages[tool], &mut before.stages[old]);
            self.stages[tool].keep_energy(moves);
        }
        for device in &mut before.devices {
            let _ = device.write(Wrench::default());
        }
        std::mem::swap(&mut self.ends.commands, &mut before.ends.commands);
        self.ends.commands.remap(previous_ranks);
        self.status = Status {
            readings: remap_by_rank(&before.status.readings, previous_ranks),
            wrenches: remap_by_rank(&before.status.wrenches, previous_ranks),
            ports: remap_by_rank(&before.status.ports, previous_ranks),
            ..before.status
        };
        std::mem::swap(&mut self.timing, &mut before.timing);
        std::mem::swap(&mut self.ends.rows, &mut before.ends.rows);
        (self.fault, self.start_ns, self.row) = (before.fault, before.start_ns, before.row.take());
    }

    /// Begins a recording that has been asked for, in a new state.
    fn begin_record(&mut self, now_ns: u64, period: f64) {
        let recorder = &mut self.ends.recorder;
        if recorder.exchange(&mut self.state, &mut self.stages) {
            self.ends.strain.begin(recorder.number);
        }
        recorder.begin_tick((now_ns, period), self.fault, &self.stages);
    }

    /// Takes commands, changes and strain responses that have arrived since the last tick.
    fn receive(&mut self, period: f64) -> Input {
        let reset = self.ends.commands.receive(&mut self.settings);
        let mut controls = self.settings.controls(reset, period, &self.limited);
        if !reset {
            // A reset ends strikes, that of its tick included.
            controls.strike = self.ends.commands.next_strike(&self.state);
        }
        let record = self.ends.recorder.input();
        (record.settings, record.reset, record.strike) = (self.settings, reset, controls.strike);
        record.strain = StrainArrivals::default();
        self.ends.strain.receive(&mut self.state, &mut record.strain);
        self.ends.series.receive(&self.model, &mut self.state);
        if controls.reset {
            self.fault = self.fault.filter(|fault| fault.outlasts_reset());
            self.timing.reset();
            self.stages.iter_mut().for_each(SafetyStage::reset);
        }
        Input { controls, ..Input::default() }
    }

    /// Reads the devices. A tool with a fault is out of the scene.
    fn read_devices(&mut self, input: &mut Input, now_ns: u64, period: f64) {
        for (tool, (device, stage)) in self.devices.iter_mut().zip(&mut self.stages).enumerate() {
            let result = device.read(now_ns, period);
            self.ends.recorder.input().readings[tool] = result;
            let admitted = stage.accept_reading(result, now_ns, period);
            let reading = &mut self.status.readings[tool];
            // What is published stays a place: a number that is none would end every picture of the scene.
            match admitted.filter(|new| new.pose.is_finite()) {
                Some(new) => *reading = new,
                None => reading.active = false,
            }
            let faultless = self.fault.is_none() && stage.fault().is_none();
            input.tools[tool] = ToolInput {
                pose: reading.pose,
                twist: reading.twist,
                active: reading.active && faultless,
                grab: reading.buttons.grab(),
            };
        }
    }

    /// Wrenches of the devices, made safe.
    fn write_devices(&mut self, output: &Output, period: f64) {
        let common = self.fault;
        let share = SafetyStage::scene_share(&mut self.stages);
        for (tool, (device, stage)) in self.devices.iter_mut().zip(&mut self.stages).enumerate() {
            common.into_iter().for_each(|reason| stage.latch(reason));
            if output.unsound[tool] {
                stage.latch(FaultReason::ContactUnsound);
            }
            let computed = ComputedWrench { law: output.unlimited[tool], limited: output.wrench_on_device[tool] };
            let wrench = stage.apply(computed, share, period);
            self.status.wrenches[tool] = wrench;
            self.status.ports[tool] = stage.energy();
            if let Err(fault) = device.write(wrench) {
                stage.latch(FaultReason::Device(fault));
            }
            let (port, limited, fault) = (recorded_port(stage.energy()), output.limited[tool], stage.fault());
            *self.ends.recorder.tool(tool) = RecordedTool { computed, wrench, port, limited, fault };
        }
    }

    fn request_strain(&mut self, input: &Input) {
        let (ends, limits) = (&mut self.ends, &input.controls.strain_limit);
        let unsent = ends.strain.ask(&self.state, limits, ends.recorder.number, self.skipped);
        ends.recorder.input().strain.unsent = unsent;
    }

    /// Numbers of this tick; the row of the last one goes out.
    fn account(&mut self, now_ns: u64, output: &Output) {
        self.timing.account(&mut self.status);
        self.push_row();
        let start_ns = *self.start_ns.get_or_insert(now_ns);
        let status = &mut self.status;
        status.time = 1e-9 * now_ns.saturating_sub(start_ns) as f64;
        (status.settings, status.limited) = (self.settings, output.limited);
        status.fault = fault(self.fault, &self.stages);
        status.recording = self.ends.recorder.progress;
        for (tool, blocks) in self.model.tools.iter().zip(&mut status.series_blocks) {
            for (body, blocks) in self.state.bodies.iter().zip(blocks) {
                *blocks = body.series(tool.radius).map_or(0, |series| series.known_blocks);
            }
        }
        let mut row = LogRow {
            time: status.time,
            position: status.readings[0].pose.position,
            force: status.wrenches[0].force,
            forces: status.wrenches.map(|wrench| wrench.force),
            wakeup_us: 1e-3 * self.timing.delay_ns() as f64,
            watched: self
                .settings
                .watch
                .map(|(body, node)| self.state.displacement_of(&self.model, body, node as usize)),
            ..LogRow::default()
        };
        for (body, state) in self.state.bodies.iter().enumerate() {
            if let Some(motion) = &state.motion {
                (row.body_time[body], row.energy[body]) = (motion.time, motion.energy());
            }
        }
        self.row = Some(row);
    }

    fn publish(&mut self) {
        let published = self.ends.published.input_buffer_mut();
        self.state.snapshot_into(&mut published.state);
        published.status = self.status;
        self.ends.published.publish();
    }

    fn push_row(&mut self) {
        if let Some(row) = self.row.take() {
            self.status.dropped_rows += u64::from(self.ends.rows.push(row).is_err());
        }
    }

    /// No wrench on any device; the last row and the status go out. A device that panics again is left alone.
    fn release(&mut self) {
        for device in &mut self.devices {
            let _ = catch_unwind(AssertUnwindSafe(|| device.write(Wrench::default())));
        }
        self.push_row();
        self.status.wrenches = [Wrench::default(); MAX_TOOLS];
        self.status.fault = fault(self.fault, &self.stages);
        self.publish();
    }
}

/// As of [`ForceLoop::check_period`], of the devices' limits alone: it may be asked while another thread ticks.
///
/// # Errors
/// The same.
pub fn check_period(model: &Model, devices: &[DeviceLimits], period: f64) -> Result<()> {
    for (tool, limits) in devices.iter().enumerate() {
        let (rate, most) = (1.0 / period, limits.rate.unwrap_or(f64::INFINITY));
        refuse_unless(period >= 1.0 / most, || {
            format!("a device takes at most {most} wrenches a second, the loop has {rate}")
        })?;
        check_stiffness(model, tool, limits, Some(period))?;
    }
    Ok(())
}

/// A loop that is to take the place of the running one: with another scene, at rest.
///
/// Everything that depends on the scene is made anew beside the loop. It takes over what goes on: contacts between bodies and
/// tools that stay go on without a step in their force; a new tool's or device's forces ramp in; a device that leaves is left
/// without a wrench.
pub(crate) struct Successor {
    pub force_loop: ForceLoop,
    /// Which bodies and tools stay.
    pub previous_ranks: PreviousRanks,
    /// Which tools keep their device.
    pub keeps_device: Vec<bool>,
}

/// Each new rank's value: of a tool that stays the one it had.
fn remap_by_rank<T: Copy + Default>(values: &[T; MAX_TOOLS], previous_ranks: &PreviousRanks) -> [T; MAX_TOOLS] {
    previous_ranks.tools.map(|old| old.and_then(|old| values.get(old)).copied().unwrap_or_default())
}

/// The devices are left without a wrench.
impl Drop for ForceLoop {
    fn drop(&mut self) {
        self.release();
    }
}

/// The fault of the whole loop, or of the first tool that has one.
fn fault(common: Option<FaultReason>, stages: &[SafetyStage]) -> Option<Fault> {
    let of_tool = |(tool, stage): (usize, &SafetyStage)| Some(Fault { tool: Some(tool), reason: stage.fault()? });
    common.map(|reason| Fault { tool: None, reason }).or_else(|| stages.iter().enumerate().find_map(of_tool))
}
