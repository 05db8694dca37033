//! Sticking contacts dragged and lifted: forces end without a jump, energy is only lost, and drags within the cone are as
//! they were.

use glam::DVec3;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{Contact, Input, Model, Pose, Scratch, Snapshot, State, ToolInput, step};

use crate::common::{DELTA, TOOL, scene, single};

/// Most tangential force of a sticking press, over its pressing force.
const CONE: f64 = 5.0;

/// Where the tip goes after it has been pressed to a depth: as far along x, and up again. All m; ticks for each.
struct Drag {
    start: DVec3,
    depth: f64,
    along: f64,
    ticks: usize,
}

impl Drag {
    /// From 1 mm above, down, along, up to 1 mm above, and back along.
    fn path(&self) -> impl Iterator<Item = DVec3> + '_ {
        let above = self.start + DVec3::Z * (TOOL.radius + 1e-3);
        let (down, along) = (DVec3::NEG_Z * (self.depth + 1e-3), DVec3::X * self.along);
        let ways = [(DVec3::ZERO, down), (down, along), (down + along, -down), (along, -along)];
        ways.into_iter().flat_map(move |(from, way)| {
            (1..=self.ticks).map(move |tick| above + from + way * (tick as f64 / self.ticks as f64))
        })
    }
}

/// What one tool felt: forces on the device and contacts, by tick; and energies of the first body at the end, if it moves.
struct Felt {
    positions: Vec<DVec3>,
    forces: Vec<DVec3>,
    contacts: Vec<Option<Contact>>,
    energy: Option<Energy>,
}

impl Felt {
    /// Work that the hand did, J, and the largest that it had done at any tick, given the weight of the new force in the mean one
    /// of a step.
    fn work(&self, weight: f64) -> (f64, f64) {
        let (mut work, mut peak) = (0.0, 0.0_f64);
        for tick in 1..self.forces.len() {
            let mean = (1.0 - weight) * self.forces[tick - 1] + weight * self.forces[tick];
            work -= mean.dot(self.positions[tick] - self.positions[tick - 1]);
            peak = peak.max(work);
        }
        (work, peak)
    }

    /// Largest change of force in one tick, N.
    fn jump(&self) -> f64 {
        self.forces.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f64::max)
    }
}

/// Runs drags of several tools side by side.
fn run(model: &Model, drags: &[Drag]) -> Vec<Felt> {
    let (mut state, mut scratch) = (State::new(model), Scratch::new(model));
    let mut input = Input::default();
    input.controls.contact_radius = [0.02; palpate_core::simulation::MAX_TOOLS];
    let paths: Vec<Vec<DVec3>> = drags.iter().map(|drag| drag.path().collect()).collect();
    let mut felt: Vec<Felt> = paths
        .iter()
        .map(|path| Felt { positions: path.clone(), forces: Vec::new(), contacts: Vec::new(), energy: None })
        .collect();
    for tick in 0..paths[0].len() {
        for (tool, path) in paths.iter().enumerate() {
            input.tools[tool] = ToolInput { pose: Pose::at(path[tick]), active: true, ..ToolInput::default() };
        }
        let output = step(model, &mut state, &mut scratch, &input);
        for (tool, felt) in felt.iter_mut().enumerate() {
            felt.forces.push(output.wrench_on_device[tool].force);
            let contact = state.contacts.iter().find(|(contact, _)| contact.tool == tool);
            felt.contacts.push(contact.map(|(contact, _)| *contact));
        }
    }
    let mut snapshot = Snapshot::new(model);
    state.snapshot_into(&mut snapshot);
    felt.iter_mut().for_each(|felt| felt.energy = snapshot.energy(0));
    felt
}

fn parts(contact: &Contact) -> (f64, f64) {
    let pressing = -contact.force.dot(contact.normal);
    (pressing, (contact.force + contact.normal * pressing).length())
}

/// A drag of seven times the depth, lifted.
fn steep(x: f64, y: f64) -> Drag {
    Drag { start: DVec3::new(x, y, 0.1), depth: 0.002, along: 0.014, ticks: 200 }
}

#[test]
fn a_drag_is_lifted_without_a_jump() {
    // At rest and in motion, where the coupling is softer; two tools on one body, that slip under each other's forces.
    let scenes = [
        (single(false), vec![steep(0.04, 0.05)]),
        (single(true), vec![steep(0.04, 0.05)]),
        (scene(false, false), vec![steep(0.035, 0.03), steep(0.045, 0.07)]),
    ];
    for (number, (model, drags)) in scenes.iter().enumerate() {
        for felt in run(model, drags) {
            let forces = felt.contacts.iter().flatten().map(parts);
            let largest = forces.clone().map(|(_, tangential)| tangential).fold(0.0, f64::max);
            // Without the cone all of that is let go of within one tick. Where one of two tools comes off, the other takes
            // over what it carried.
            let part = felt.jump() / largest;
            assert!(
                largest > 1.0 && part < if drags.len() == 1 { 0.03 } else { 0.08 },
                "{number}: {part} of {largest} N"
            );
            let widest = forces.clone().map(|(pressing, tangential)| tangential / pressing).fold(0.0, f64::max);
            assert!(widest <= CONE * (1.0 + if drags.len() == 1 { 2e-9 } else { 1e-3 }), "{number}: {widest}");
            assert!(felt.contacts.last().is_some_and(Option::is_none), "lifted");
            // Each slip loses energy, and none is given out on the way.
            let (work, peak) = felt.work(0.5);
            assert!(work > 0.0 && work < peak, "{number}: {work} J of {peak} J");
            let anchors: Vec<_> = felt.contacts.iter().flatten().map(|contact| contact.anchor).collect();
            assert!(anchors.first() != anchors.last(), "it slipped");
            // The account has the whole work of the tool, by the mean force that Newmark's scheme does work with, and what slips
            // lost of it.
            if let Some(energy) = felt.energy {
                let (work, _) = felt.work(DELTA);
                let held = energy.kinetic + energy.strain + energy.coupling + energy.dissipated;
                // Of the steps in which the contact begins and ends the account has the part in touch.
                assert!((energy.work / work - 1.0).abs() < 1e-4, "{} J booked of {work} J", energy.work);
                // What is missing is the scheme's own damping, of modes and coupling.
                let missing = 1.0 - held / energy.work;
                assert!((0.0..0.01).contains(&missing), "{held} J of {} J", energy.work);
            }
        }
    }
}

/// The anchor of a contact is all that a slip changes, and forces follow from it.
#[test]
fn a_drag_within_the_cone_does_not_slip() {
    for moving in [false, true] {
        let drag = Drag { depth: 0.004, along: 0.004, ..steep(0.04, 0.05) };
        // Down and along; the lift of any drag passes its cone.
        let before_the_lift = 2 * drag.ticks;
        let felt = &run(&single(moving), &[drag])[0];
        let contacts: Vec<_> = felt.contacts[..before_the_lift].iter().flatten().collect();
        assert!(contacts.len() > 300 && parts(contacts[contacts.len() - 1]).1 > 0.3);
        assert!(contacts.iter().all(|contact| contact.anchor == contacts[0].anchor));
    }
}
