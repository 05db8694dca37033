//! Largest stiffness that the loop holds on an emulated device, beside theory.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use num_complex::Complex64;
use palpate_core::simulation::{LawKind, MAX_BODIES, Model, Pose, ToolModel};
use palpate_devices::emulated::{Command, Hand, HandTarget, Mechanics, Tip, emulated};
use palpate_devices::{Buttons, DeviceLimits};
use palpate_servo::{EmulatedTick, Emulation, SafetyLimits, Script, Settings, StrainPreparer, run};

use crate::common::{TOOL, settings, single_with};

/// On the cube's top, away from its edges: a tool that holds on there is a linear spring.
const PLACE: DVec3 = DVec3::new(0.05, 0.05, 0.1);

/// Speed at which the tip is struck, m/s.
const STRUCK: f64 = 1e-2;

/// The stage without what withholds force or adds any: theory speaks of the loop alone.
const BARE: SafetyLimits = SafetyLimits {
    max_force: f64::INFINITY,
    max_torque: f64::INFINITY,
    max_slew: f64::INFINITY,
    max_torque_slew: f64::INFINITY,
    max_damping: 0.0,
    max_angular_damping: 0.0,
    ramp: 0.0,
    max_reading_age: f64::INFINITY,
    max_speed: f64::INFINITY,
    max_compute: f64::INFINITY,
    max_overruns: u32::MAX,
};

/// A cube under a tool, held at [`PLACE`], and its stiffness there at a scale of one.
struct Held {
    model: Arc<Model>,
    /// N/m.
    stiffness: DMat3,
    largest: f64,
    /// Along which it is stiffest.
    direction: DVec3,
}

impl Held {
    /// Under a tool that asks for at most `max_stiffness`, N/m.
    fn new(max_stiffness: f64) -> Self {
        let tool = ToolModel { law: LawKind::PATCH, max_stiffness, ..TOOL };
        let model = single_with(tool);
        let step = 1e-4;
        let poses: Vec<Pose> =
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|axis| Pose::at(PLACE + step * axis)).into();
        let script = Script { period: 1e-3, poses: &poses, grabs: &[true; 4], strikes: &[], watch: &[], devices: &[] };
        let recording = run(&model, BARE, settings(), &StrainPreparer::new(&model), &script, |_| {}).expect("a run");
        let column = |axis: usize| -recording.forces[axis + 1] / step;
        let stiffness = DMat3::from_cols(column(0), column(1), column(2));
        let mut direction = DVec3::ONE;
        (0..2000).for_each(|_| direction = (stiffness * direction).normalize());
        Self { model, stiffness, largest: direction.dot(stiffness * direction), direction }
    }

    /// Ticks of a tip that holds on, with the body's stiffness at a scale.
    fn run(&self, tip: Tip, period: f64, scale: f64, mut each: impl FnMut(&EmulatedTick) -> ControlFlow<()>) {
        let settings = Settings { stiffness_scale: [scale; MAX_BODIES], ..settings() };
        let strain = StrainPreparer::new(&self.model);
        let emulation = Emulation { model: &self.model, limits: BARE, settings, strain: &strain, period };
        let (mut handle, device) = emulated("emulated", tip, DeviceLimits::UNLIMITED);
        handle.set(Command { buttons: Buttons::GRAB, ..Command::default() });
        let ran = emulation.run(vec![(handle, device)], |tick, _| {
            assert_eq!(tick.fault, None);
            each(tick)
        });
        ran.expect("a run");
    }

    /// Whether a tip that is struck along the stiffest direction loses energy in the long run.
    fn is_stable(&self, mechanics: Mechanics, period: f64, stiffness: f64) -> bool {
        // At the edge of stability energy grows or fades with (b - K tau) / m.
        let ticks = (40.0 * mechanics.mass / mechanics.damping / period).max(400.0) as usize;
        let tip = Tip::new(mechanics, PLACE, None).moving(STRUCK * self.direction);
        let scale = stiffness / self.largest;
        let scaled = self.stiffness * scale;
        let (mut middle, mut end) = (0.0, 0.0);
        self.run(tip, period, scale, |tick| {
            let true_motion = tick.true_motions[0];
            let x = true_motion.position - PLACE;
            let energy = mechanics.mass * true_motion.velocity.length_squared() + x.dot(scaled * x);
            match 5 * tick.number / ticks {
                2 => middle += energy,
                4 => end += energy,
                _ => {}
            }
            // Beyond any doubt, before it overflows.
            let runs_away = x.length() > 1.0;
            end = if runs_away { f64::INFINITY } else { end };
            if runs_away || tick.number == ticks { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        // Below that rounding alone moves it.
        end < middle.max(1e-12 * mechanics.mass * STRUCK * STRUCK)
    }

    /// By bisection, N/m, to 0.1 %.
    fn largest_stable(&self, mechanics: Mechanics, period: f64) -> f64 {
        let bound = bound(&mechanics, period);
        let (mut stable, mut unstable) = (0.5 * bound, 4.0 * bound);
        assert!(self.is_stable(mechanics, period, stable) && !self.is_stable(mechanics, period, unstable));
        while unstable > 1.001 * stable {
            let middle = (stable * unstable).sqrt();
            if self.is_stable(mechanics, period, middle) { stable = middle } else { unstable = middle }
        }
        stable
    }
}

/// Colgate and Schenkel's, with the delay: for any hand.
fn bound(mechanics: &Mechanics, period: f64) -> f64 {
    mechanics.damping / (0.5 * period + mechanics.delay)
}

/// Largest stiffness for the mass alone, N/m, from the sampled system: where the first pair of poles is on the unit circle.
///
/// Over a period the force of `n + 1` periods ago acts for the time `rest` of the delay, `d = n T + rest`, and then that of `n`
/// periods ago. With the motion of a mass in a viscous medium this gives position over force `G(z)`; the loop's poles are the
/// roots of `1 + K G(z)`, so at the edge `K = -1 / G(exp(i angle))`, real.
fn largest_for_the_mass(mechanics: &Mechanics, period: f64) -> f64 {
    let Mechanics { mass, damping, delay, .. } = *mechanics;
    let (whole, rest) = ((delay / period).floor(), delay % period);
    // Velocity and way that a unit force makes within t, and way that a unit velocity makes.
    let velocity = |t: f64| -(-damping / mass * t).exp_m1() / damping;
    let coasting = |t: f64| mass * velocity(t);
    let way = |t: f64| (t - coasting(t)) / damping;
    let decay = |t: f64| (-damping / mass * t).exp();
    let later = period - rest;
    let transfer = |angle: f64| {
        let z = Complex64::cis(angle);
        let older = z.powf(-whole) / z;
        let newer = z.powf(-whole);
        let v = (newer * velocity(later) + older * velocity(rest) * decay(later)) / (z - decay(period));
        let pushed = newer * way(later) + older * (way(rest) + velocity(rest) * coasting(later));
        (v * coasting(period) + pushed) / (z - 1.0)
    };
    let (mut low, mut high) = (1e-6, 1e-6);
    while transfer(high).im < 0.0 {
        (low, high) = (high, 1.01 * high);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if transfer(middle).im < 0.0 { low = middle } else { high = middle }
    }
    -1.0 / transfer(low).re
}

fn mechanics(mass: f64, damping: f64, delay: f64) -> Mechanics {
    Mechanics { mass, damping, delay, dry_friction: 0.0, encoder_step: 0.0 }
}

/// A mass heavy enough that its oscillation is slow beside half a period and the delay feels nothing of them but their
/// negative damping `K (T/2 + d)`: it needs all of the device's own, as the worst of hands does.
#[test]
fn the_largest_stable_stiffness_of_a_heavy_tip_is_the_bound_for_any_hand() {
    let held = Held::new(1e9);
    for (mass, damping, period, delay) in [
        (0.2, 0.8, 1e-3, 0.0),
        (0.1, 2.0, 0.5e-3, 0.0),
        (0.2, 0.8, 1e-3, 0.4e-3),
        (0.2, 0.8, 1e-3, 1e-3),
        (0.2, 1.5, 1e-3, 2.7e-3),
    ] {
        let mechanics = mechanics(mass, damping, delay);
        let found = held.largest_stable(mechanics, period);
        let (bound, exact) = (bound(&mechanics, period), largest_for_the_mass(&mechanics, period));
        println!("{mass} kg {damping} N s/m {period} s {delay} s: {found:.1}, bound {bound:.1}, exact {exact:.1} N/m");
        assert!((found / bound - 1.0).abs() < 0.05, "{found} {bound}");
        assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
    }
}

/// A lighter tip oscillates faster, and a delay that is long beside its period turns part of the spring's force away from
/// the velocity: with `theta` the phase of half a period and the delay, `theta tan theta = b (T/2 + d) / m`, the mass alone holds
/// `theta / sin theta` times the bound.
#[test]
fn a_light_tip_holds_more() {
    let held = Held::new(1e9);
    let (damping, period) = (0.8, 1e-3);
    for (delay, share) in [(0.0, 0.5), (0.0, 2.0), (1.6e-3, 0.5), (1.6e-3, 2.0)] {
        let late: f64 = 0.5 * period + delay;
        let mechanics = mechanics(damping * late / share, damping, delay);
        let found = held.largest_stable(mechanics, period);
        let (bound, exact) = (bound(&mechanics, period), largest_for_the_mass(&mechanics, period));
        let mut theta = 0.5_f64;
        (0..200).for_each(|_| theta = (0.5 * (theta + (share / theta).atan())).min(1.57));
        println!(
            "{:.2e} kg: {found:.1}, bound {bound:.1}, exact {exact:.1}, by theta {:.1}",
            mechanics.mass,
            bound * theta / theta.sin()
        );
        assert!((found / exact - 1.0).abs() < 0.01, "{found} {exact}");
        assert!(found > bound * (1.0 + 0.8 * (theta / theta.sin() - 1.0)), "{found} {bound}");
    }
}

/// Speed of a tip in the last of two seconds under a steady push, m/s, on a spring that is the same in all directions.
fn speed_at_the_end(mechanics: Mechanics, stiffness: f64, push: f64) -> f64 {
    // Muscles so soft that the force is steady.
    let hand = Hand { mass: 0.0, damping: 0.0, stiffness: 1.0, target: HandTarget::At(PLACE - push * DVec3::Z) };
    let tip = Tip::new(mechanics, PLACE, Some(hand));
    // A body far stiffer than the tool may ask for: all the compliance is that in series.
    let held = Held::new(stiffness);
    let mut speed = 0.0_f64;
    held.run(tip, 1e-3, 1e4, |tick| {
        speed = if tick.number < 1000 { 0.0 } else { speed.max(tick.true_motions[0].velocity.z.abs()) };
        if tick.number == 2000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    speed
}

/// A push between the forces of two steps of the encoder finds no balance but by friction: the tip hops to and fro between
/// them for ever unless `f >= K step / 2` (Abbott and Okamura, Effects of position quantization and sampling rate on
/// virtual-wall passivity, IEEE Trans. Robotics 21, 2005), however well the stiffness suits the damping.
#[test]
fn dry_friction_must_hold_half_a_step_of_the_encoder() {
    let step = 5e-5;
    let tip = |friction: f64| Mechanics { encoder_step: step, dry_friction: friction, ..mechanics(0.1, 0.8, 0.0) };
    let stiffness = 0.5 * bound(&tip(0.0), 1e-3);
    let enough = 0.5 * stiffness * step;
    for steps in [3.0, 11.0] {
        let push = stiffness * (steps + 0.5) * step;
        for (friction, rests) in [(0.0, false), (0.9 * enough, false), (1.1 * enough, true), (3.0 * enough, true)] {
            let speed = speed_at_the_end(tip(friction), stiffness, push);
            println!("{steps} steps, friction {:.2} of K step / 2: {speed:.2e} m/s", friction / enough);
            assert_eq!(speed == 0.0, rests, "{friction} of {enough}: {speed}");
        }
    }
}

/// Beyond the bound a cycle of amplitude `A` gains `pi (K T/2 - b) omega A^2` and dry friction takes `4 f A`: a tip that is
/// struck comes to rest while it swings less than `4 f / (pi (K T/2 - b) omega)`, and runs away beyond.
#[test]
fn dry_friction_holds_more_until_the_tip_is_struck_harder() {
    let (period, friction) = (1e-3, 0.05);
    let tip = Mechanics { dry_friction: friction, ..mechanics(0.1, 0.8, 0.0) };
    let stiffness = 1.5 * bound(&tip, period);
    let held = Held::new(stiffness);
    let comes_to_rest = |speed: f64| {
        let mut moves = true;
        held.run(Tip::new(tip, PLACE, None).moving(speed * DVec3::Z), period, 1e4, |tick| {
            let true_motion = tick.true_motions[0];
            moves = true_motion.velocity != DVec3::ZERO || tick.number == 0;
            let ends = !moves || true_motion.position.distance(PLACE) > 0.1 || tick.number == 20_000;
            if ends { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        !moves
    };
    let (mut rests, mut runs_away) = (0.01, 1.0);
    assert!(comes_to_rest(rests) && !comes_to_rest(runs_away));
    while runs_away > 1.005 * rests {
        let middle = f64::sqrt(rests * runs_away);
        if comes_to_rest(middle) { rests = middle } else { runs_away = middle }
    }
    // The speed of that amplitude.
    let expected = 4.0 * friction / (std::f64::consts::PI * (0.5 * stiffness * period - tip.damping));
    println!("struck at {rests:.4} m/s, by the balance of energy {expected:.4} m/s");
    assert!((rests / expected - 1.0).abs() < 0.05, "{rests} {expected}");
}
