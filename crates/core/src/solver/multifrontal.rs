//! Multifrontal factorisation: supernode by supernode; the update of each is added to its parent and then dropped.
//!
//! The caller takes the finished columns of every supernode and keeps what it needs of them, in the form and the number
//! format it needs: the factor as a whole is never held. A left-looking factorisation must hold all of it in double
//! precision, twice as much as what is kept in single precision.
//!
//! Memory beside what is kept: the updates of finished supernodes whose parents wait, one front, and what waits to be used
//! by the next ones, no more than the largest. So large fronts come
//! one after the other, each shared by the threads; threads have subtrees of their own only where these are small.

use std::sync::Mutex;

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use rayon::prelude::*;

use super::buffers::Buffers;
use super::front::{ColumnEntries, Eliminated, Front, Update, UpdateMatrix, front_numbers};
use crate::{Error, Result};

/// A subtree of less than this part of all operations is shared by the threads, one of less than a sixteenth of that is
/// computed by one.
const UNIT: f64 = 1.0 / 64.0;
const GROUP: f64 = UNIT / 16.0;
/// Operations below which sharing costs more than it gains.
const LEAST: f64 = 2e7;

/// No parent.
const NONE: u32 = u32::MAX;

/// The order in which the supernodes are eliminated.
pub struct Schedule {
    parents: Vec<u32>,
    children: Vec<Vec<u32>>,
    units: Vec<Unit>,
}

/// Supernodes whose turns come together.
#[derive(Default)]
struct Unit {
    /// Subtrees of one thread each, children before parents.
    groups: Vec<Vec<u32>>,
    /// Those above them, children before parents, each shared by the threads.
    rest: Vec<u32>,
}

impl Schedule {
    /// Orders the supernodes of a structure.
    pub fn new(structure: &SymbolicSupernodalCholesky<usize>) -> Self {
        let count = structure.n_supernodes();
        let parents = parents(structure);
        let mut children = vec![Vec::new(); count];
        let mut work: Vec<f64> = (0..count).map(|s| operations(structure, s)).collect();
        for (s, &parent) in parents.iter().enumerate().filter(|(_, parent)| **parent != NONE) {
            children[parent as usize].push(s as u32);
            work[parent as usize] += work[s];
        }
        let total: f64 = (0..count).filter(|&s| parents[s] == NONE).map(|s| work[s]).sum();
        let (unit, group) = ((total * UNIT).max(16.0 * LEAST), (total * GROUP).max(LEAST));
        // Highest supernode of the unit and of the group that each belongs to, from the roots down.
        let mut unit_of = vec![NONE; count];
        let mut group_of = vec![NONE; count];
        for s in (0..count).rev() {
            let inherited = |of: &[u32]| if parents[s] == NONE { NONE } else { of[parents[s] as usize] };
            let highest = |of: &[u32], bound: f64| match inherited(of) {
                NONE if work[s] <= bound => s as u32,
                above => above,
            };
            (unit_of[s], group_of[s]) = (highest(&unit_of, unit), highest(&group_of, group));
        }
        let mut members: Vec<Unit> = (0..count).map(|_| Unit::default()).collect();
        let mut place_of_group = vec![NONE; count];
        for s in 0..count {
            let of_unit = &mut members[if unit_of[s] == NONE { s } else { unit_of[s] as usize }];
            match group_of[s] {
                NONE => of_unit.rest.push(s as u32),
                highest => {
                    let place = &mut place_of_group[highest as usize];
                    if *place == NONE {
                        *place = of_unit.groups.len() as u32;
                        of_unit.groups.push(Vec::new());
                    }
                    of_unit.groups[*place as usize].push(s as u32);
                }
            }
        }
        members.retain(|unit| !(unit.groups.is_empty() && unit.rest.is_empty()));
        Self { parents, children, units: members }
    }

    /// Most bytes that fronts, updates and what is kept take together, with as many groups at a time as `threads`; `kept(s)`
    /// is what is kept of a supernode.
    pub fn peak_bytes(
        &self,
        structure: &SymbolicSupernodalCholesky<usize>,
        threads: usize,
        result_numbers: &dyn Fn(usize) -> usize,
    ) -> usize {
        let mut account = MemoryCount { schedule: self, structure, result_numbers, held: 0, peak: 0 };
        for unit in &self.units {
            let before = account.held;
            let mut tops = Vec::new();
            for group in &unit.groups {
                let (peak, held) = (account.peak, account.held);
                account.peak = held;
                group.iter().for_each(|&s| account.eliminate(s as usize));
                tops.push(account.peak - held);
                account.peak = account.peak.max(peak);
            }
            tops.sort_unstable();
            // Others of the group may be finished or not, those that run are at their peaks.
            let running: usize = tops.iter().rev().take(threads).sum();
            account.peak = account.peak.max(before.max(account.held) + running);
            unit.rest.iter().for_each(|&s| account.eliminate(s as usize));
        }
        account.peak + 8 * self.largest_front(structure)
    }

    /// Numbers of the largest front.
    fn largest_front(&self, structure: &SymbolicSupernodalCholesky<usize>) -> usize {
        (0..self.parents.len()).map(|s| numbers(structure, s).0).max().unwrap_or(0)
    }

    /// Eliminates everything; `columns` has the entries on and below the diagonal by position, `keep` is handed the columns of
    /// each supernode, `interrupt` asked now and then.
    ///
    /// # Errors
    /// A pivot that is not positive, or that of `interrupt`.
    pub fn run<Kept: Send>(
        &self,
        structure: &SymbolicSupernodalCholesky<usize>,
        columns: ColumnEntries<'_>,
        keep: &(dyn Fn(&Eliminated) -> Kept + Sync),
        interrupt: &(dyn Fn() -> Result<()> + Sync),
    ) -> Result<Vec<Kept>> {
        let run = Run {
            schedule: self,
            structure,
            columns,
            buffers: Buffers::new(self.largest_front(structure)),
            updates: (0..self.parents.len()).map(|_| Mutex::new(None)).collect(),
            results: (0..self.parents.len()).map(|_| Mutex::new(None)).collect(),
            keep,
        };
        let mut places = vec![0; structure.supernode_end().last().copied().unwrap_or(0)];
        for unit in &self.units {
            interrupt()?;
            let groups = unit.groups.par_iter().with_max_len(1);
            let memory = || vec![0; places.len()];
            groups.map_init(memory, |places, group| run.eliminate(group, places)).collect::<Result<()>>()?;
            for s in &unit.rest {
                interrupt()?;
                run.eliminate(std::slice::from_ref(s), &mut places)?;
            }
        }
        let missing = || Error::Invalid("a supernode was left out of the factorisation".into());
        run.results.into_iter().map(|results| results.into_inner().ok().flatten().ok_or_else(missing)).collect()
    }
}

/// What a factorisation works on.
struct Run<'a, Kept> {
    schedule: &'a Schedule,
    structure: &'a SymbolicSupernodalCholesky<usize>,
    columns: ColumnEntries<'a>,
    buffers: Buffers,
    updates: Vec<Mutex<Option<Update>>>,
    results: Vec<Mutex<Option<Kept>>>,
    keep: &'a (dyn Fn(&Eliminated) -> Kept + Sync),
}

impl<Kept> Run<'_, Kept> {
    /// Eliminates some supernodes in their order; `places` has room for every position.
    fn eliminate(&self, supernodes: &[u32], places: &mut [u32]) -> Result<()> {
        for s in supernodes.iter().map(|&s| s as usize) {
            let (eliminated, update) = self.front(s, places).eliminate()?;
            if self.schedule.parents[s] != NONE {
                put(&self.updates[s], update);
            }
            put(&self.results[s], (self.keep)(&eliminated));
            eliminated.recycle(&self.buffers);
        }
        Ok(())
    }

    /// The assembled front of a supernode.
    fn front(&self, s: usize, places: &mut [u32]) -> Front {
        let positions = self.structure.supernode_begin()[s]..self.structure.supernode_end()[s];
        let boundary = self.structure.supernode(s).pattern();
        for (place, position) in positions.clone().chain(boundary.iter().copied()).enumerate() {
            places[position] = place as u32;
        }
        let places = &*places;
        let addend = |&child: &u32| {
            let pattern = self.structure.supernode(child as usize).pattern();
            let places = pattern.iter().map(|&position| places[position]).collect();
            take(&self.updates[child as usize]).map(|update| UpdateMatrix::new(update, places))
        };
        let children = self.schedule.children[s].iter().filter_map(addend).collect();
        let own = |column: usize, see: &mut dyn FnMut(usize, f64)| {
            (self.columns)(positions.start + column, &mut |row, value| see(places[row] as usize, value));
        };
        Front::new(positions.len(), boundary.len(), &own, children, &self.buffers)
    }
}

fn put<T>(slot: &Mutex<Option<T>>, value: T) {
    if let Ok(mut slot) = slot.lock() {
        *slot = Some(value);
    }
}

fn take<T>(slot: &Mutex<Option<T>>) -> Option<T> {
    slot.lock().ok().and_then(|mut slot| slot.take())
}

/// Memory as it is taken and given back, bytes.
struct MemoryCount<'a> {
    schedule: &'a Schedule,
    structure: &'a SymbolicSupernodalCholesky<usize>,
    result_numbers: &'a dyn Fn(usize) -> usize,
    held: usize,
    peak: usize,
}

impl MemoryCount<'_> {
    fn eliminate(&mut self, s: usize) {
        let numbers = |s: usize| {
            let (front, update) = numbers(self.structure, s);
            (8 * front, 8 * update)
        };
        let (front, update) = numbers(s);
        let children: usize = self.schedule.children[s].iter().map(|&child| numbers(child as usize).1).sum();
        let update = if self.schedule.parents[s] == NONE { 0 } else { update };
        let result_numbers = (self.result_numbers)(s);
        self.peak = self.peak.max(self.held + front);
        self.held = self.held - children + result_numbers;
        self.peak = self.peak.max(self.held + front);
        self.held += update;
    }
}

/// Numbers of the front of a supernode, and of its update.
fn numbers(structure: &SymbolicSupernodalCholesky<usize>, s: usize) -> (usize, usize) {
    let (size, boundary) = sizes(structure, s);
    front_numbers(size, boundary)
}

/// Number of a supernode's columns, and of the rows of its boundary.
pub fn sizes(structure: &SymbolicSupernodalCholesky<usize>, s: usize) -> (usize, usize) {
    let size = structure.supernode_end()[s] - structure.supernode_begin()[s];
    (size, structure.supernode(s).pattern().len())
}

/// The supernode of each one's first boundary row.
fn parents(structure: &SymbolicSupernodalCholesky<usize>) -> Vec<u32> {
    let count = structure.n_supernodes();
    let of_position = |position: usize| structure.supernode_end().partition_point(|&end| end <= position) as u32;
    (0..count).map(|s| structure.supernode(s).pattern().first().map_or(NONE, |&row| of_position(row))).collect()
}

/// Operations of a supernode's elimination: a column with `c` numbers below its diagonal takes `(c + 1)^2`.
pub fn operations(structure: &SymbolicSupernodalCholesky<usize>, s: usize) -> f64 {
    let (size, below) = sizes(structure, s);
    (1..=size).map(|k| ((below + k) as f64).powi(2)).sum()
}
