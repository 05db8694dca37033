//! The operators of a body and their accuracy, in the number format that is asked for or that the body needs.

use super::free_response::{FreeResponse, free_response};
use super::inverse::Inverse;
use super::layout::Layout;
use super::number::Number;
use super::phase::{Listener, Phase};
use super::plan::{Bounds, Prepared, Route};
use super::probe::{Probe, Squares};
use super::problem::Problem;
use super::sweep::Sweep;
use super::system::System;
use super::tree::Tree;
use crate::fem::SymmetricCsc;
use crate::green::accuracy::Accuracy;
use crate::green::precision::Precision;
use crate::solver::multifrontal::Schedule;
use crate::solver::{Symbolic, condition, require_regular};
use crate::{Error, Result};

/// The number format asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// This one.
    Named(Precision),
    /// The cheapest whose typical contacts are right to this relative error; the best if none is.
    Within(f64),
}

impl Wanted {
    /// The format, if it is named.
    pub fn named(self) -> Option<Precision> {
        match self {
            Wanted::Named(precision) => Some(precision),
            Wanted::Within(_) => None,
        }
    }
}

/// The sweeps, by what they compute with.
pub enum Sweeps {
    /// Of a store of halves.
    Single(Sweep<f32>),
    /// Of others.
    Double(Sweep<f64>),
}

/// Everything that is known when the columns are begun.
pub struct Made {
    /// Stiffness of all dofs.
    pub stiffness: SymmetricCsc,
    /// Rows and columns.
    pub layout: Layout,
    /// The blocks.
    pub route: Route,
    /// The sweeps.
    pub sweeps: Sweeps,
    /// What the loads do.
    pub response: FreeResponse,
    /// Number format.
    pub precision: Precision,
    /// Its accuracy.
    pub accuracy: Accuracy,
}

/// Factorises, measures and chooses; `phase` is told of the steps, `go_on` asked now and then.
///
/// # Errors
/// A singular stiffness, a bound of memory that cannot be kept, or an interruption.
pub fn made(
    problem: &Problem,
    wanted: Wanted,
    memory: Option<usize>,
    in_memory: bool,
    phase: Listener<'_>,
    go_on: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Made> {
    let prepared = Prepared::new(problem, phase)?;
    let bounds = Bounds { memory, in_memory };
    let mut routes = match wanted {
        Wanted::Named(precision) => vec![(precision, prepared.route(precision, bounds)?)],
        Wanted::Within(_) => fitting(&prepared, bounds)?,
    };
    go_on()?;
    let double = prepared.route(Precision::F32, bounds);
    let Prepared { stiffness, symbolic, layout, tree, schedule } = prepared;
    let system = System { stiffness: &stiffness, supports: &problem.supports, layout: &layout };
    let (symbolic, schedule, tree) = (&symbolic, &schedule, &tree);
    let making =
        Making { problem, system: &system, symbolic, schedule, tree, double: double.as_ref().err(), phase, go_on };
    let candidates: Vec<Precision> = routes.iter().map(|(precision, _)| *precision).collect();
    // By a thread of the pool: one outside would sleep and be woken for every product that the threads share.
    let measured = rayon::scope(|_| match wanted {
        Wanted::Named(precision) => making.named(precision),
        Wanted::Within(bound) => making.chosen(bound, &candidates),
    });
    let Measured { sweeps, response, accuracy, precision } = measured?;
    let at = routes.iter().position(|(of, _)| *of == precision).unwrap_or(0);
    let route = match (double, &sweeps) {
        // Sixteen bits of a body that needs double precision.
        (Ok(route), Sweeps::Double(_)) if precision == Precision::F16 => route,
        _ => routes.swap_remove(at).1,
    };
    Ok(Made { stiffness, layout, route, sweeps, response, precision, accuracy })
}

/// The formats that the memory allows, the cheapest first.
fn fitting(prepared: &Prepared, bounds: Bounds) -> Result<Vec<(Precision, Route)>> {
    let routes = Precision::ALL.map(|precision| prepared.route(precision, bounds).map(|route| (precision, route)));
    let mut refusal = None;
    let mut fitting = Vec::new();
    for route in routes {
        match route {
            Ok(route) => fitting.push(route),
            Err(error) => refusal = refusal.or(Some(error)),
        }
    }
    match refusal {
        Some(error) if fitting.is_empty() => Err(error),
        _ => Ok(fitting),
    }
}

/// A format with what it achieves.
struct Measured {
    sweeps: Sweeps,
    response: FreeResponse,
    accuracy: Accuracy,
    precision: Precision,
}

/// Sweeps with what they compute on the probed patches, and the error of that.
struct Swept<C> {
    sweep: Sweep<C>,
    response: FreeResponse,
    squares: Squares,
    measured: Accuracy,
    /// Nothing gives where it may be touched.
    rigid: bool,
}

impl<C> Swept<C> {
    fn accuracy(&self, precision: Precision) -> Accuracy {
        self.squares.typical(self.measured, precision)
    }

    fn with_accuracy(self, precision: Precision, sweeps: fn(Sweep<C>) -> Sweeps) -> Measured {
        let accuracy = self.accuracy(precision);
        Measured { sweeps: sweeps(self.sweep), response: self.response, accuracy, precision }
    }
}

/// What sweeps are made of.
struct Making<'a> {
    problem: &'a Problem,
    system: &'a System<'a>,
    symbolic: &'a Symbolic,
    schedule: &'a Schedule,
    tree: &'a Tree,
    /// Why the memory does not allow operators in double precision, if it does not.
    double: Option<&'a Error>,
    phase: Listener<'a>,
    go_on: &'a (dyn Fn() -> Result<()> + Sync),
}

impl Making<'_> {
    /// Factorises and measures; `None` where numbers of this kind have too few digits for the body.
    fn swept<C: Number>(&self) -> Result<Option<Swept<C>>> {
        let (problem, system) = (self.problem, self.system);
        let (stiffness, supports) = (system.stiffness, system.supports);
        (self.phase)(Phase::Factor);
        let positions = self.symbolic.positions();
        let inverse = Inverse::<C>::new(self.symbolic, self.schedule, &positions, stiffness, supports, self.go_on)?;
        if !inverse.is_finite() {
            return Ok(None);
        }
        (self.phase)(Phase::Accuracy);
        let mut scratch = inverse.scratch();
        let softness = condition(&mut |x| inverse.solve(&mut scratch, x), stiffness, supports);
        drop(scratch);
        require_regular(&softness, &problem.mesh.nodes)?;
        (self.go_on)()?;
        let response = free_response(stiffness, &inverse, supports, &problem.loads, &system.layout.row_dofs)?;
        let (Some(response), Some(probe)) = (response, Probe::new(problem, stiffness, &inverse, &softness)) else {
            return Ok(None);
        };
        (self.go_on)()?;
        let sweep = inverse.cut(self.tree.clone())?;
        let squares = probe.squares(system, &sweep);
        let computed = probe.computed_error(&squares);
        // One residual may be small by chance: not below what the columns' residuals were beside the columns.
        let loads = response.error.max(probe.factor_error * response.size);
        let measured = Accuracy { computed, supports: probe.supports_error, loads, ..Accuracy::default() };
        Ok(Some(Swept { sweep, response, squares, measured, rigid: probe.is_empty() }))
    }

    /// Sweeps in single precision, which may not be enough for the body.
    fn single(&self) -> Result<Option<Swept<f32>>> {
        match self.swept() {
            // Double precision decides whether the body is supported.
            Err(Error::Singular(_)) => Ok(None),
            found => found,
        }
    }

    fn double(&self) -> Result<Swept<f64>> {
        let what = "rounding would spoil every digit: parts of the body differ too much in stiffness; bring materials \
                    closer together, or fix more of the body";
        if let Some(Error::Memory(reason)) = self.double {
            return Err(Error::Memory(format!("this body needs double precision: {reason}")));
        }
        self.swept()?.ok_or_else(|| Error::Singular(what.into()))
    }

    fn named(&self, precision: Precision) -> Result<Measured> {
        if precision == Precision::F16
            && let Some(single) = self.single()?
        {
            return Ok(single.with_accuracy(precision, Sweeps::Single));
        }
        Ok(self.double()?.with_accuracy(precision, Sweeps::Double))
    }

    /// The first of the candidates, the cheapest first, within the bound; else the last.
    fn chosen(&self, bound: f64, candidates: &[Precision]) -> Result<Measured> {
        let within = |accuracy: Accuracy| accuracy.touch.max(accuracy.stamp) <= bound;
        if candidates.contains(&Precision::F16)
            && let Some(single) = self.single()?
            && (candidates.len() == 1 || within(single.accuracy(Precision::F16)) && !single.rigid)
        {
            return Ok(single.with_accuracy(Precision::F16, Sweeps::Single));
        }
        let double = self.double()?;
        let mut others = candidates.iter().copied().filter(|&p| p != Precision::F16 || candidates.len() == 1);
        // Where nothing gives there is nothing to measure a format by.
        let fits = |&precision: &Precision| double.rigid || within(double.accuracy(precision));
        let best = candidates.last().copied().unwrap_or(Precision::F64);
        let precision = others.find(fits).unwrap_or(best);
        Ok(double.with_accuracy(precision, Sweeps::Double))
    }
}
