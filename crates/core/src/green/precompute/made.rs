//! The operators of a body and their accuracy, in the number format that is asked for or that the body needs.

use faer::Par;

use super::free_response::{FreeResponse, free_response};
use super::layout::Layout;
use super::number::Number;
use super::operators::operators;
use super::plan::{Bounds, Prepared, Route};
use super::probe::{Probe, Squares};
use super::problem::Problem;
use super::sweep::Sweep;
use super::system::System;
use super::tree::Tree;
use crate::Result;
use crate::fem::SymmetricCsc;
use crate::green::accuracy::Accuracy;
use crate::green::precision::Precision;
use crate::solver::{Factor, condition, require_regular};

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

/// Factorises, measures and chooses; `go_on` is asked between the steps.
///
/// # Errors
/// A singular stiffness, a bound of memory that cannot be kept, or an interruption.
pub fn made(
    problem: &Problem,
    wanted: Wanted,
    memory: Option<usize>,
    in_memory: bool,
    go_on: &dyn Fn() -> Result<()>,
) -> Result<Made> {
    let prepared = Prepared::new(problem)?;
    let bounds = Bounds { memory, in_memory, choosing: wanted.named().is_none() };
    let mut routes = match wanted {
        Wanted::Named(precision) => vec![(precision, prepared.route(precision, bounds)?)],
        Wanted::Within(_) => fitting(&prepared, bounds)?,
    };
    go_on()?;
    let Prepared { stiffness, symbolic, layout, tree } = prepared;
    let factor = symbolic.factorise(Par::rayon(0))?;
    let softness = condition(&factor, &stiffness, &problem.supports);
    require_regular(&softness, &problem.mesh.nodes)?;
    go_on()?;
    let response = free_response(&stiffness, &factor, &problem.supports, &problem.loads, &layout.row_dofs)?;
    let system = System { stiffness: &stiffness, supports: &problem.supports, layout: &layout };
    let probe = Probe::new(problem, &system, &factor, &softness);
    // One residual may be small by chance: not below what the columns' residuals were beside the columns.
    let loads = response.error.max(probe.factor_error * response.size);
    let measuring = Measuring { system: &system, probe: &probe, factor: &factor, loads };
    let candidates: Vec<Precision> = routes.iter().map(|(precision, _)| *precision).collect();
    let Measured { sweeps, accuracy, precision } = match wanted {
        Wanted::Named(precision) => measuring.named(tree, precision)?,
        Wanted::Within(bound) => measuring.chosen(tree, bound, &candidates)?,
    };
    let at = routes.iter().position(|(of, _)| *of == precision).unwrap_or(0);
    let (_, route) = routes.swap_remove(at);
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
    accuracy: Accuracy,
    precision: Precision,
}

/// Sweeps with what they compute on the probed patches, and the error of that.
struct Swept<C> {
    sweep: Sweep<C>,
    squares: Squares,
    computed: f64,
}

/// What accuracies are measured with.
struct Measuring<'a> {
    system: &'a System<'a>,
    probe: &'a Probe,
    factor: &'a Factor,
    loads: f64,
}

impl Measuring<'_> {
    fn swept<C: Number>(&self, tree: Tree) -> Result<Swept<C>> {
        let operators = operators::<C>(&tree, self.factor.supernodal()?);
        let sweep = Sweep { tree, operators };
        let squares = self.probe.squares(self.system, &sweep);
        let computed = self.probe.computed_error(&squares);
        Ok(Swept { sweep, squares, computed })
    }

    fn single(&self, tree: Tree) -> Result<Measured> {
        let Swept { sweep, squares, computed } = self.swept(tree)?;
        let accuracy = squares.typical(computed, self.loads, Precision::F16);
        Ok(Measured { sweeps: Sweeps::Single(sweep), accuracy, precision: Precision::F16 })
    }

    fn named(&self, tree: Tree, precision: Precision) -> Result<Measured> {
        if precision == Precision::F16 {
            return self.single(tree);
        }
        let Swept { sweep, squares, computed } = self.swept(tree)?;
        let accuracy = squares.typical(computed, self.loads, precision);
        Ok(Measured { sweeps: Sweeps::Double(sweep), accuracy, precision })
    }

    /// The first of the candidates, the cheapest first, within the bound; else the last.
    fn chosen(&self, mut tree: Tree, bound: f64, candidates: &[Precision]) -> Result<Measured> {
        let within = |accuracy: Accuracy| accuracy.touch.max(accuracy.stamp) <= bound;
        let &[.., best] = candidates else { return self.named(tree, Precision::F64) };
        if self.probe.is_empty() && candidates.contains(&Precision::F32) {
            // Nothing gives where it may be touched: nothing to measure a format by.
            return self.named(tree, Precision::F32);
        }
        if best == Precision::F16 {
            return self.single(tree);
        }
        let mut double = self.swept::<f64>(tree)?;
        // Sixteen bits are computed in single precision: worth trying only where their rounding alone is within.
        if candidates[0] == Precision::F16 && within(double.squares.typical(0.0, 0.0, Precision::F16)) {
            let single = self.single(double.sweep.tree)?;
            if within(single.accuracy) {
                return Ok(single);
            }
            let Sweeps::Single(Sweep { tree: same, .. }) = single.sweeps else { return Ok(single) };
            tree = same;
            double = self.swept(tree)?;
        }
        let accuracy_of = |precision| double.squares.typical(double.computed, self.loads, precision);
        let precision = candidates.iter().copied().filter(|&p| p != Precision::F16);
        let precision = precision.into_iter().find(|&p| within(accuracy_of(p))).unwrap_or(best);
        let accuracy = accuracy_of(precision);
        Ok(Measured { sweeps: Sweeps::Double(double.sweep), accuracy, precision })
    }
}
