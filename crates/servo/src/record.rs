//! Record of a tick: all of its input, bit for bit, and its output.
//!
//! The record has a fixed size and is pushed into a ring; a tick that finds the ring full goes on without it. What came in
//! is enough to make the same tick again: the settings, the time, what the devices said, which strain responses came, and
//! the fault that timing or a driver had latched before.

use glam::DVec3;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{
    Contact, Contacts, MAX_BODIES, MAX_CONTACTS, MAX_TOOLS, Mode, Model, State, Strike, Wrench,
};
use palpate_devices::{DeviceFault, Reading};

use crate::safety::{ComputedWrench, FaultReason, PortEnergy};
use crate::settings::Settings;

/// Requests for strain and responses that may be under way.
pub(crate) const IN_FLIGHT: usize = 16;

/// What came into a tick and what it answered.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord {
    /// Ticks since the recording began.
    pub tick: u64,
    /// What came in.
    pub input: RecordedInput,
    /// What came out; the same input gives the same bits.
    pub output: RecordedOutput,
    /// Delay between the time the tick was due and its begin, ns.
    pub delay_ns: u64,
    /// Time that the whole tick took, ns.
    pub took_ns: u64,
}

impl TickRecord {
    /// Of no tick.
    pub(crate) fn empty() -> Self {
        let input = RecordedInput {
            due_ns: 0,
            period: 0.0,
            settings: Settings::default(),
            reset: false,
            strike: None,
            readings: [Ok(Reading::default()); MAX_TOOLS],
            strain: StrainArrivals::default(),
            fault: None,
            tool_faults: [None; MAX_TOOLS],
        };
        Self { tick: 0, input, output: RecordedOutput::default(), delay_ns: 0, took_ns: 0 }
    }
}

/// What came into a tick.
#[derive(Clone, Copy, Debug)]
pub struct RecordedInput {
    /// Time for which the tick was due, ns of the monotonic clock.
    pub due_ns: u64,
    /// Time between two ticks, s.
    pub period: f64,
    /// Settings of this tick.
    pub settings: Settings,
    /// Whether everything was let go of.
    pub reset: bool,
    /// The strike that was given.
    pub strike: Option<Strike>,
    /// What each device said.
    pub readings: [Result<Reading, DeviceFault>; MAX_TOOLS],
    /// Strain responses that came before this tick.
    pub strain: StrainArrivals,
    /// Fault of the whole loop, and of each tool, when the tick began.
    pub fault: Option<FaultReason>,
    /// See `fault`.
    pub tool_faults: [Option<FaultReason>; MAX_TOOLS],
}

/// Strain responses, named by what asked for them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrainArrivals {
    arrived: [StrainRequestId; IN_FLIGHT],
    count: usize,
    /// A bit for each body whose request found no room in the tick.
    pub unsent: u32,
}

/// Identity of a strain request: its body and the tick that sent it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrainRequestId {
    /// Whose contacts.
    pub body: usize,
    /// The tick that asked, counted as in [`TickRecord::tick`].
    pub tick: u64,
}

impl StrainArrivals {
    /// One more; beyond what can be under way it is left out.
    pub fn push(&mut self, asked: StrainRequestId) {
        if let Some(place) = self.arrived.get_mut(self.count) {
            *place = asked;
            self.count += 1;
        }
    }

    /// Counts the ticks that asked from another one.
    pub(crate) fn count_from(&mut self, first: u64) {
        self.arrived[..self.count].iter_mut().for_each(|asked| asked.tick = asked.tick.saturating_sub(first));
    }

    /// Those that came.
    pub fn arrived(&self) -> &[StrainRequestId] {
        &self.arrived[..self.count]
    }
}

/// What a tick answered.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordedOutput {
    /// One a tool of the model; those behind them are empty.
    pub tools: [RecordedTool; MAX_TOOLS],
    /// The contacts.
    pub contacts: RecordedContacts,
    /// Time (s) and energies of each body in motion.
    pub bodies: [Option<(f64, Energy)>; MAX_BODIES],
}

/// What a tick answered to one tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordedTool {
    /// What the contact laws asked for, and what the limit of strain left of it.
    pub computed: ComputedWrench,
    /// What went out to the device.
    pub wrench: Wrench,
    /// Energy at the device's port, given, owed and never paid, J, to five digits.
    pub port: [f32; 3],
    /// Whether the limit of strain kept the tool from following its device.
    pub limited: bool,
    /// The tool's fault after the tick.
    pub fault: Option<FaultReason>,
}

/// The contacts of a tick.
#[derive(Clone, Copy, Debug)]
pub struct RecordedContacts {
    contacts: [RecordedContact; MAX_CONTACTS],
    count: usize,
}

/// A contact, to five digits: what is exact is the wrench of its tool. Vectors are in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RecordedContact {
    /// Index of the tool.
    pub tool: u8,
    /// Index of the body.
    pub body: u8,
    /// Whether it presses or holds on.
    pub mode: Mode,
    /// Whether it slips.
    pub slipping: bool,
    /// Whether the limit of strain holds it back.
    pub limited: bool,
    /// Contact point on the untouched surface, m.
    pub point: [f32; 3],
    /// Unit outward normal there.
    pub normal: [f32; 3],
    /// Force on the body as computed, N: on the device it comes made safe.
    pub force: [f32; 3],
    /// Torque on the body about the tip, N m; none below [`LEAST_TORQUE`].
    pub torque: [f32; 3],
    /// Contact radius under the local law, m.
    pub radius: f32,
    /// Approach of the tool and the surface at rest under the local law, m.
    pub depth: f32,
    /// Felt stiffness along the normal under the local law, N/m.
    pub stiffness: f32,
    /// Estimated relative error of the force; zero for a linear material.
    pub error: f32,
}

/// Torques below this are rounding errors, N m: those of a sphere without friction.
const LEAST_TORQUE: f64 = 1e-12;

fn without_rounding(torque: DVec3) -> DVec3 {
    if torque.abs().max_element() < LEAST_TORQUE { DVec3::ZERO } else { torque }
}

/// The nearest number of 16 binary digits, five decimal ones: the bytes that stay zero take no room in a compressed file.
fn rounded(number: f64) -> f32 {
    let single = number as f32;
    // A carry into the exponent is right, but for what is not finite.
    if single.is_finite() { f32::from_bits((single.to_bits() + 0x80) & !0xff) } else { single }
}

impl Default for RecordedContacts {
    fn default() -> Self {
        Self { contacts: [RecordedContact::default(); MAX_CONTACTS], count: 0 }
    }
}

impl RecordedContacts {
    /// Those that touch.
    pub fn of(model: &Model, contacts: &Contacts) -> Self {
        contacts.iter().map(|(contact, _)| RecordedContact::of(model, contact)).collect()
    }

    /// One after the other.
    pub fn iter(&self) -> std::slice::Iter<'_, RecordedContact> {
        self.contacts[..self.count].iter()
    }
}

/// Beyond what a model may have they are left out.
impl FromIterator<RecordedContact> for RecordedContacts {
    fn from_iter<I: IntoIterator<Item = RecordedContact>>(contacts: I) -> Self {
        let mut all = Self::default();
        for (place, contact) in all.contacts.iter_mut().zip(contacts) {
            *place = contact;
            all.count += 1;
        }
        all
    }
}

impl RecordedContact {
    fn of(model: &Model, contact: &Contact) -> Self {
        let placement = &model.bodies[contact.body].placement;
        let vector = |vector: DVec3| vector.to_array().map(rounded);
        Self {
            tool: contact.tool as u8,
            body: contact.body as u8,
            mode: contact.mode,
            slipping: contact.slipping,
            limited: contact.limited,
            point: vector(placement.point_to_world(contact.point)),
            normal: vector(placement.vector_to_world(contact.normal)),
            force: vector(placement.vector_to_world(contact.force)),
            torque: vector(without_rounding(-placement.vector_to_world(contact.torque))),
            radius: rounded(contact.radius),
            depth: rounded(contact.depth),
            stiffness: rounded(contact.stiffness),
            error: rounded(contact.error),
        }
    }
}

/// Energy at a port, to five digits.
pub(crate) fn recorded_port(port: PortEnergy) -> [f32; 3] {
    [port.given, port.owed, port.unpaid].map(rounded)
}

/// Time and energies of the bodies in motion.
pub(crate) fn recorded_bodies(state: &State) -> [Option<(f64, Energy)>; MAX_BODIES] {
    let mut bodies = [None; MAX_BODIES];
    for (to, body) in bodies.iter_mut().zip(&state.bodies) {
        *to = body.motion.as_ref().map(|motion| (motion.time, motion.energy()));
    }
    bodies
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_digits_are_kept() {
        for number in [1.0, -0.123456789, 3.0e-5, 7.77e4, 0.999999, 1.0 + 1.0 / 65536.0] {
            let error = (f64::from(rounded(number)) / number - 1.0).abs();
            assert!(error <= 0.5 / 32768.0 && rounded(number).to_bits() & 0xff == 0, "{number} {error}");
        }
        assert_eq!(rounded(0.0), 0.0);
        assert!(rounded(f64::NAN).is_nan() && rounded(f64::INFINITY).is_infinite());
    }
}
