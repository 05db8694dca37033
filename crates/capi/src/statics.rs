//! Static solutions without a loop: a pressed patch, changed boundary conditions.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use palpate_core::capacitance::{self, Change, SplitConditions};
use palpate_core::contact;
use palpate_core::green::GreensFunction;
use palpate_core::green::accuracy::require_right;

use crate::arguments::{array, exclusive, optional_mut, require_count, shared};
use crate::status::{Outcome, Refusal, Status, catching_panics};
use crate::store::Store;

/// A condition on a surface node displaces it, m; components that are not numbers stay as they are.
pub const PALPATE_CONDITION_DISPLACEMENT: u32 = 0;
/// A condition on a surface node is a force, N, besides the body's own loads.
pub const PALPATE_CONDITION_FORCE: u32 = 1;
/// A condition on a surface node takes its support away; its value does not matter.
pub const PALPATE_CONDITION_RELEASE: u32 = 2;

/// A condition on a surface node. Never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Condition {
    /// The surface node: its row in palpate_store_get_positions.
    pub node: u32,
    /// PALPATE_CONDITION_DISPLACEMENT, _FORCE or _RELEASE.
    pub kind: u32,
    /// m or N; a component that is not a number (NAN) is left as it is.
    pub value: [f64; 3],
}

/// Presses the patch of `radius` (m; 0 is a point) around the surface point closest to `point` (m, in the body's own frame)
/// by `displacement` (m; NAN leaves a component free). `force` (N) is that on the body; `displacements` are those of the
/// surface nodes, x y z of each, m, or null; `error` is the estimated relative error, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_touch(
    store: *const Store,
    point: *const f64,
    displacement: *const f64,
    radius: f64,
    force: *mut f64,
    displacements: *mut f64,
    nodes: usize,
    error: *mut f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers, to three numbers each.
        let (store, point, wanted, force) = unsafe {
            (
                shared(store, "store")?,
                shared(point.cast::<[f64; 3]>(), "point")?,
                shared(displacement.cast::<[f64; 3]>(), "displacement")?,
                exclusive(force.cast::<[f64; 3]>(), "force")?,
            )
        };
        if !(radius >= 0.0 && radius.is_finite()) {
            return Err(Refusal::argument(format!("radius is {radius} m, it must not be negative")));
        }
        // SAFETY: the caller's pointers.
        let (all, error_out) = unsafe { (answers(store, displacements, nodes)?, error.as_mut()) };
        let wanted = wanted.map(|d| (!d.is_nan()).then_some(d));
        if wanted.iter().flatten().any(|d| !d.is_finite()) {
            return Err(Refusal::argument("displacement is not finite"));
        }
        let touch = contact::touch(&store.green, (*point).into(), wanted, radius)?;
        require_right("the answer", touch.error)?;
        *force = touch.force.to_array();
        all.into_iter().for_each(|all| all.copy_from_slice(&touch.displacements));
        error_out.into_iter().for_each(|error_out| *error_out = touch.error);
        Ok(())
    })
}

/// Answers a change of boundary conditions exactly. `displacements` (m) and `forces` (N: K u, with applied loads, contact
/// forces and reactions of supports) are of the surface nodes, x y z of each, and may be null; so may `error`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_solve(
    store: *const Store,
    conditions: *const Condition,
    count: usize,
    displacements: *mut f64,
    forces: *mut f64,
    nodes: usize,
    error: *mut f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (store, conditions) = unsafe { (shared(store, "store")?, array(conditions, count, "conditions")?) };
        // SAFETY: the caller's pointers.
        let (u, f, error_out) =
            unsafe { (answers(store, displacements, nodes)?, answers(store, forces, nodes)?, error.as_mut()) };
        let (known, switched) = sorted(&store.green, conditions)?;
        let answer = capacitance::solve(&store.green, &known, &switched)?;
        require_right("the answer", answer.error)?;
        u.into_iter().for_each(|u| u.copy_from_slice(&answer.displacements));
        f.into_iter().for_each(|f| f.copy_from_slice(&answer.forces));
        error_out.into_iter().for_each(|error_out| *error_out = answer.error);
        Ok(())
    })
}

/// A place for three numbers of every surface node, if one is given.
///
/// # Safety
/// The pointer is null or points to `nodes` of three numbers.
unsafe fn answers<'a>(store: &Store, place: *mut f64, nodes: usize) -> Outcome<Option<&'a mut [f64]>> {
    if !place.is_null() {
        require_count("nodes", nodes, store.green.surface_count())?;
    }
    // SAFETY: the caller's.
    Ok(unsafe { optional_mut(place, 3 * nodes) })
}

/// Conditions by column of the operator, in ascending order.
fn sorted(green: &GreensFunction, conditions: &[Condition]) -> Outcome<SplitConditions> {
    let mut change = Change::default();
    for (rank, &Condition { node, kind, value }) in conditions.iter().enumerate() {
        let touchable = green.touch.binary_search(&node);
        let unknown = |_| Refusal::argument(format!("condition {rank}: surface node {node} is not touchable"));
        let first = 3 * touchable.map_err(unknown)?;
        let columns = first..first + 3;
        let given = columns.clone().zip(value).filter(|(_, value)| !value.is_nan());
        if kind != PALPATE_CONDITION_RELEASE && value.iter().any(|value| value.is_infinite()) {
            return Err(Refusal::argument(format!("condition {rank}: a value is not finite")));
        }
        match kind {
            PALPATE_CONDITION_DISPLACEMENT => change.displacements.extend(given),
            PALPATE_CONDITION_FORCE => change.forces.extend(given),
            PALPATE_CONDITION_RELEASE => change.released.extend(columns),
            _ => return Err(Refusal::argument(format!("condition {rank}: there is no kind {kind}"))),
        }
    }
    change.sorted(green).map_err(|column| {
        let (node, axis) = (green.touch[column / 3], ["x", "y", "z"][column % 3]);
        Refusal::argument(format!("surface node {node} has both a force and a displacement along {axis}"))
    })
}
