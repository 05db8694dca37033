//! Factorization of a body: operators, block plan, free response and accuracy, in the requested number format or the
//! cheapest sufficient one.

use super::free_response::{FreeResponse, free_response};
use super::inverse::Inverse;
use super::layout::Layout;
use super::number::Number;
use super::plan::{BlockPlan, Bounds, SymbolicAnalysis};
use super::probe::{Probe, Squares};
use super::problem::Problem;
use super::sweep::Sweep;
use super::system::System;
use super::tasks::{Phase, PhaseCallback};
use super::tree::Tree;
use crate::fem::SymmetricCsc;
use crate::green::accuracy::Accuracy;
use crate::green::precision::Precision;
use crate::solver::multifrontal::Schedule;
use crate::solver::{Symbolic, condition, require_regular};
use crate::{Error, Result};

/// The requested number format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RequestedPrecision {
    /// A given one.
    Named(Precision),
    /// The cheapest whose typical contacts are right to this relative error; the best if none is.
    Within(f64),
}

impl RequestedPrecision {
    /// The format, if it is named.
    pub fn named(self) -> Option<Precision> {
        match self {
            RequestedPrecision::Named(precision) => Some(precision),
            RequestedPrecision::Within(_) => None,
        }
    }
}

/// The sweeps, by their precision.
pub enum Sweeps {
    /// Of a store of halves.
    Single(Sweep<f32>),
    /// Of others.
    Double(Sweep<f64>),
}

/// A factorized body, ready for the columns.
pub struct Factorization {
    /// Stiffness of all dofs.
    pub stiffness: SymmetricCsc,
    /// Rows and columns.
    pub layout: Layout,
    /// The blocks.
    pub route: BlockPlan,
    /// The sweeps.
    pub sweeps: Sweeps,
    /// The free response to the loads.
    pub response: FreeResponse,
    /// Number format.
    pub precision: Precision,
    /// Its accuracy.
    pub accuracy: Accuracy,
}

/// Factorises, measures and chooses; `phase` is called at each step; `interrupt` is called between steps and may stop.
///
/// # Errors
/// A singular stiffness, a bound of memory that cannot be kept, or an interruption.
pub fn factorize(
    problem: &Problem,
    requested: RequestedPrecision,
    memory: Option<usize>,
    in_memory: bool,
    phase: PhaseCallback<'_>,
    interrupt: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Factorization> {
    let prepared = SymbolicAnalysis::new(problem, phase)?;
    let bounds = Bounds { memory, in_memory };
    let mut routes = match requested {
        RequestedPrecision::Named(precision) => vec![(precision, prepared.plan_blocks(precision, bounds)?)],
        RequestedPrecision::Within(_) => fitting(&prepared, bounds)?,
    };
    interrupt()?;
    let double = prepared.plan_blocks(Precision::F32, bounds);
    let SymbolicAnalysis { stiffness, symbolic, layout, tree, schedule } = prepared;
    let system = System { stiffness: &stiffness, supports: &problem.supports, layout: &layout };
    let (symbolic, schedule, tree) = (&symbolic, &schedule, &tree);
    let builder = SweepBuilder {
        problem,
        system: &system,
        symbolic,
        schedule,
        tree,
        double: double.as_ref().err(),
        phase,
        interrupt,
    };
    let candidates: Vec<Precision> = routes.iter().map(|(precision, _)| *precision).collect();
    // On a thread of the pool: another one would sleep and wake for every product that the threads share.
    let measured = rayon::scope(|_| match requested {
        RequestedPrecision::Named(precision) => builder.with_format(precision),
        RequestedPrecision::Within(bound) => builder.cheapest_within(bound, &candidates),
    });
    let MeasuredFormat { sweeps, response, accuracy, precision } = measured?;
    let at = routes.iter().position(|(of, _)| *of == precision).unwrap_or(0);
    let route = match (double, &sweeps) {
        // Sixteen bits of a body that needs double precision.
        (Ok(route), Sweeps::Double(_)) if precision == Precision::F16 => route,
        _ => routes.swap_remove(at).1,
    };
    Ok(Factorization { stiffness, layout, route, sweeps, response, precision, accuracy })
}

/// The formats that the memory allows, the cheapest first: at least one.
///
/// # Errors
/// A bound of memory that the cheapest cannot keep.
pub fn fitting(prepared: &SymbolicAnalysis, bounds: Bounds) -> Result<Vec<(Precision, BlockPlan)>> {
    let plan = |precision| Some((precision, prepared.plan_blocks(precision, bounds).ok()?));
    let fitting: Vec<_> = Precision::ALL.into_iter().filter_map(plan).collect();
    if fitting.is_empty() {
        prepared.plan_blocks(Precision::F16, bounds)?;
    }
    Ok(fitting)
}

/// A format with its accuracy.
struct MeasuredFormat {
    sweeps: Sweeps,
    response: FreeResponse,
    accuracy: Accuracy,
    precision: Precision,
}

/// Sweeps with their results on the probed patches, and the error of these.
struct ProbedSweep<C> {
    sweep: Sweep<C>,
    response: FreeResponse,
    squares: Squares,
    measured: Accuracy,
    /// Nothing in the touch region is compliant.
    rigid: bool,
}

impl<C> ProbedSweep<C> {
    fn accuracy(&self, precision: Precision) -> Accuracy {
        self.squares.typical(self.measured, precision)
    }

    fn with_accuracy(self, precision: Precision, sweeps: fn(Sweep<C>) -> Sweeps) -> MeasuredFormat {
        let accuracy = self.accuracy(precision);
        MeasuredFormat { sweeps: sweeps(self.sweep), response: self.response, accuracy, precision }
    }
}

/// Inputs of the sweeps.
struct SweepBuilder<'a> {
    problem: &'a Problem,
    system: &'a System<'a>,
    symbolic: &'a Symbolic,
    schedule: &'a Schedule,
    tree: &'a Tree,
    /// Why the memory does not allow operators in double precision, if it does not.
    double: Option<&'a Error>,
    phase: PhaseCallback<'a>,
    interrupt: &'a (dyn Fn() -> Result<()> + Sync),
}

impl SweepBuilder<'_> {
    /// Factorises and measures; `None` where numbers of this kind have too few digits for the body.
    fn factorize_and_probe<C: Number>(&self) -> Result<Option<ProbedSweep<C>>> {
        let (problem, system) = (self.problem, self.system);
        let (stiffness, supports) = (system.stiffness, system.supports);
        (self.phase)(Phase::Factor);
        let positions = self.symbolic.positions();
        let inverse = Inverse::<C>::new(self.symbolic, self.schedule, &positions, stiffness, supports, self.interrupt)?;
        if !inverse.is_finite() {
            return Ok(None);
        }
        (self.phase)(Phase::Accuracy);
        let mut scratch = inverse.scratch();
        let softness = condition(&mut |x| inverse.solve(&mut scratch, x), stiffness, supports);
        drop(scratch);
        require_regular(&softness, &problem.mesh.nodes)?;
        (self.interrupt)()?;
        let response = free_response(stiffness, &inverse, supports, &problem.loads, &system.layout.row_dofs)?;
        let (Some(response), Some(probe)) = (response, Probe::new(problem, stiffness, &inverse, &softness)) else {
            return Ok(None);
        };
        (self.interrupt)()?;
        let sweep = inverse.cut(self.tree.clone())?;
        let squares = probe.squares(system, &sweep);
        let computed = probe.computed_error(&squares);
        // One residual may be small by chance: it is not taken as smaller than the columns' own, relative to the columns.
        let loads = response.error.max(probe.factor_error * response.size);
        let measured = Accuracy { computed, supports: probe.supports_error, loads, ..Accuracy::default() };
        Ok(Some(ProbedSweep { sweep, response, squares, measured, rigid: probe.is_empty() }))
    }

    /// Sweeps in single precision, which may not be enough for the body.
    fn single(&self) -> Result<Option<ProbedSweep<f32>>> {
        match self.factorize_and_probe() {
            // Double precision decides whether the body is supported.
            Err(Error::Singular(_)) => Ok(None),
            found => found,
        }
    }

    fn double(&self) -> Result<ProbedSweep<f64>> {
        let what = "rounding would spoil every digit: parts of the body differ too much in stiffness; bring materials \
                    closer together, or fix more of the body";
        if let Some(Error::Memory(reason)) = self.double {
            return Err(Error::Memory(format!("this body needs double precision: {reason}")));
        }
        self.factorize_and_probe()?.ok_or_else(|| Error::Singular(what.into()))
    }

    fn with_format(&self, precision: Precision) -> Result<MeasuredFormat> {
        if precision == Precision::F16
            && let Some(single) = self.single()?
        {
            return Ok(single.with_accuracy(precision, Sweeps::Single));
        }
        Ok(self.double()?.with_accuracy(precision, Sweeps::Double))
    }

    /// The first of the candidates, the cheapest first, within the bound; else the last.
    fn cheapest_within(&self, bound: f64, candidates: &[Precision]) -> Result<MeasuredFormat> {
        let within = |accuracy: Accuracy| accuracy.touch.max(accuracy.stamp) <= bound;
        if candidates.contains(&Precision::F16)
            && let Some(single) = self.single()?
            && (candidates.len() == 1 || within(single.accuracy(Precision::F16)) && !single.rigid)
        {
            return Ok(single.with_accuracy(Precision::F16, Sweeps::Single));
        }
        let double = self.double()?;
        let mut others = candidates.iter().copied().filter(|&p| p != Precision::F16 || candidates.len() == 1);
        // Without a compliant node there is no measure of a format.
        let fits = |&precision: &Precision| double.rigid || within(double.accuracy(precision));
        let best = candidates.last().copied().unwrap_or(Precision::F64);
        let precision = others.find(fits).unwrap_or(best);
        Ok(double.with_accuracy(precision, Sweeps::Double))
    }
}
