//! Offline runs: the same ticks without a clock, from a script or from recorded inputs.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::Result;
use palpate_core::contact::Refusal;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{Model, Pose, Strike};
use palpate_devices::DeviceLimits;

use crate::force_loop::ForceLoop;
use crate::handoff::LOG_ROWS;
use crate::platform::computed_ns;
use crate::preparation::Preparation;
use crate::preparer::StrainPreparer;
use crate::record::{RecordedInput, TickRecord};
use crate::replay::{ReplayedDevice, hand_over};
use crate::safety::{Fault, SafetyLimits};
use crate::settings::{Settings, check_node, refuse_unless};
use crate::stepper::Stepper;

/// What happens, tick by tick.
pub struct Script<'a> {
    /// Time between two ticks, s.
    pub period: f64,
    /// Where the tools are, (ticks x tools): all tools of a tick, then those of the next. A position that is not finite
    /// takes the tool out of the scene.
    pub poses: &'a [Pose],
    /// Which tools hold on to what they touch, (ticks x tools); empty if none ever does.
    pub grabs: &'a [bool],
    /// Strikes and their ticks, in order and at most one a tick.
    pub strikes: &'a [(usize, Strike)],
    /// Bodies and the ranks of their surface nodes whose displacements are recorded.
    pub watch: &'a [(usize, u32)],
    /// What the device of each tool can render; empty for anything.
    pub devices: &'a [DeviceLimits],
}

/// What a script did.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Force on each device at each tick (ticks x tools), N.
    pub forces: Vec<DVec3>,
    /// Torque about each tip at each tick (ticks x tools), N m.
    pub torques: Vec<DVec3>,
    /// For each body that moves its index, and its energies at each tick.
    pub energies: Vec<(usize, Vec<Energy>)>,
    /// Displacements of the watched nodes at each tick (ticks x nodes), m, in their body's frame.
    pub displacements: Vec<DVec3>,
    /// Whether the limit of strain kept each tool from following its device (ticks x tools).
    pub limited: Vec<bool>,
    /// What each tick took of the thread's time, ns: the only part that differs from run to run.
    pub compute_ns: Vec<u64>,
    /// The first fault that latched.
    pub fault: Option<Fault>,
    /// The first tick in which a tool reached a body without a contact, and why.
    pub refused: Option<(usize, Refusal)>,
}

/// Ticks through a script, settings unchanged but for its strikes, and hands out a record of each tick.
///
/// # Errors
/// See [`ForceLoop::new`]; a script of the wrong shape, or with a body or node that the model does not have.
pub fn run(
    model: &Arc<Model>,
    limits: SafetyLimits,
    settings: Settings,
    strain: &StrainPreparer,
    script: &Script<'_>,
    mut each: impl FnMut(&TickRecord),
) -> Result<Recording> {
    check(model, script)?;
    let tools = model.tools.len();
    let mut stepper = Stepper::new(model, script.devices, limits, settings, strain)?;
    let mut records = stepper.handle.begin_recording()?;
    let mut strikes = script.strikes.iter().peekable();
    let moving = (0..model.bodies.len()).filter(|&body| model.bodies[body].moves());
    let mut recording = Recording { energies: moving.map(|body| (body, Vec::new())).collect(), ..Recording::default() };
    for (tick, poses) in script.poses.chunks_exact(tools).enumerate() {
        if let Some(&(_, strike)) = strikes.next_if(|(when, _)| *when == tick) {
            stepper.handle.strike(strike)?;
        }
        let grabs = script.grabs.get(tick * tools..(tick + 1) * tools).unwrap_or_default();
        stepper.prepare(poses, grabs, script.period);
        let begun = computed_ns();
        stepper.tick();
        recording.compute_ns.push(computed_ns() - begun);
        stepper.finish();
        records.pop().iter().for_each(&mut each);
        let published = stepper.handle.latest();
        let (status, state) = (&published.status, &published.state);
        recording.fault = recording.fault.or(status.fault);
        let mut refusals = state.tools[..tools].iter().flat_map(|tool| tool.refused.iter().flatten());
        recording.refused = recording.refused.or_else(|| refusals.next().map(|&refusal| (tick, refusal)));
        recording.forces.extend(status.wrenches[..tools].iter().map(|wrench| wrench.force));
        recording.limited.extend(&status.limited[..tools]);
        recording.torques.extend(status.wrenches[..tools].iter().map(|wrench| wrench.torque));
        for (body, energies) in &mut recording.energies {
            energies.extend(state.energy(*body));
        }
        for &(body, node) in script.watch {
            recording.displacements.extend(state.displacements_of(model, body, &[node]));
        }
    }
    Ok(recording)
}

/// Ticks through recorded inputs without looking at what came out of them: what the devices said, strikes, resets and the
/// pace of bodies are as recorded, all other settings as given, and devices can render so much. Hands out a record of each
/// tick.
///
/// # Errors
/// See [`ForceLoop::new`]; an input that cannot be had, or a strike on a body that the model does not have.
pub fn rerun(
    model: &Arc<Model>,
    devices: &[DeviceLimits],
    limits: SafetyLimits,
    settings: Settings,
    strain: &StrainPreparer,
    inputs: impl IntoIterator<Item = Result<RecordedInput>>,
    mut each: impl FnMut(&TickRecord),
) -> Result<()> {
    let (mut readings, devices): (Vec<_>, _) = devices.iter().map(|&limits| ReplayedDevice::boxed(limits)).unzip();
    let (mut force_loop, mut handle) = ForceLoop::without_clock(model, devices, limits, settings, strain, LOG_ROWS)?;
    let mut preparation = Preparation::new(&mut handle, strain)?;
    let mut records = handle.begin_recording()?;
    let mut settings = settings;
    for (tick, input) in inputs.into_iter().enumerate() {
        let input = input?;
        settings.time_scale = input.settings.time_scale;
        hand_over(&input, settings, &mut handle, &mut readings)?;
        preparation.hand_over(tick);
        force_loop.tick(input.due_ns, input.period);
        preparation.prepare(tick);
        records.pop().iter().for_each(&mut each);
    }
    Ok(())
}

fn check(model: &Model, script: &Script<'_>) -> Result<()> {
    let (tools, poses, grabs) = (model.tools.len(), script.poses.len(), script.grabs.len());
    refuse_unless(script.period > 0.0 && script.period.is_finite(), || {
        format!("the time between two ticks must be positive, got {} s", script.period)
    })?;
    refuse_unless(poses % tools == 0, || format!("{poses} poses are not a whole number of ticks of {tools} tools"))?;
    refuse_unless(grabs == 0 || grabs == poses, || format!("there are {poses} poses, but {grabs} grabs"))?;
    let ticks = script.strikes.iter().map(|(tick, _)| *tick);
    refuse_unless(ticks.clone().zip(ticks.clone().skip(1)).all(|(a, b)| a < b), || {
        "strikes must be in order of time, one a tick".into()
    })?;
    refuse_unless(ticks.clone().all(|tick| tick < poses / tools), || {
        format!("a strike comes after the last of {} ticks", poses / tools)
    })?;
    script.watch.iter().try_for_each(|&(body, node)| check_node(model, body, node))
}
