//! Blocks of `Psi` against sums over its entries one by one, and what they cost beside copying the entries.

mod common;

use std::time::Instant;

use common::cube;
use glam::{DMat3, DVec3};
use palpate_core::green::{GreensFunction, Precision, TouchNode, precompute};

const PRECISIONS: [Precision; 3] = [Precision::F16, Precision::F32, Precision::F64];

/// Numbers without pattern (Knuth's linear congruential generator), from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn shuffle(&mut self, items: &mut [u32]) {
        for k in (1..items.len()).rev() {
            items.swap(k, (self.next() * (k + 1) as f64) as usize);
        }
    }
}

/// A cube of which about half of the surface is touchable, supported nodes among it.
fn body(cells: u32, precision: Precision) -> GreensFunction {
    let mut problem = cube(cells);
    let mut random = Random(7);
    problem.touch.retain(|_| random.next() < 0.6);
    precompute(&problem, precision, &|_, _| true).expect("a supported body")
}

/// Some touchable nodes in no order, with weights.
fn patch(green: &GreensFunction, count: usize, seed: u64) -> (Vec<u32>, Vec<TouchNode>, Vec<f64>) {
    let mut random = Random(seed);
    let mut nodes = green.touch.clone();
    random.shuffle(&mut nodes);
    nodes.truncate(count);
    let columns = nodes.iter().map(|&node| green.touchable(node as usize).expect("a touchable node")).collect();
    let weights = nodes.iter().map(|_| random.next() - 0.2).collect();
    (nodes, columns, weights)
}

/// `W_a^T Psi W_b` entry by entry, and the sum of its terms' magnitudes.
fn naive(green: &GreensFunction, a: (&[u32], &[f64]), b: (&[u32], &[f64])) -> (DMat3, f64) {
    let (mut sum, mut size) = (DMat3::ZERO, 0.0);
    for (&j, wj) in b.0.iter().zip(b.1) {
        let rank = green.touch.binary_search(&j).expect("a touchable node");
        for (&i, wi) in a.0.iter().zip(a.1) {
            for (axis, k) in (0..9).map(|n| (n / 3, n % 3)) {
                let (row, column) = (3 * i as usize + k, 3 * rank + axis);
                if !green.row_is_fixed[row] && !green.row_is_fixed[green.row_of_column(column)] {
                    let term = wi * wj * green.entry(row, column);
                    sum.col_mut(axis)[k] += term;
                    size += term.abs();
                }
            }
        }
    }
    (sum, size)
}

fn largest_difference(a: &DMat3, b: &DMat3) -> f64 {
    (*a - *b).to_cols_array().into_iter().fold(0.0, |m, x| m.max(x.abs()))
}

#[test]
fn weighted_sums_are_those_of_the_entries() {
    for precision in PRECISIONS {
        let green = body(4, precision);
        let everywhere: Vec<u32> = (0..green.surface_count() as u32).rev().collect();
        assert!(everywhere.iter().any(|&node| green.touchable(node as usize).is_none()));
        // One node, a patch, more than a tile, all that there are.
        for count in [1, 13, 50, green.touch.len()] {
            let (nodes, columns, weights) = patch(&green, count, count as u64);
            let supported = nodes.iter().filter(|&&node| green.row_is_fixed[3 * node as usize]).count();
            assert!(count < 13 || supported > 0);
            let block = green.symmetric_block(&nodes, &columns, &weights);
            let (expected, size) = naive(&green, (&nodes, &weights), (&nodes, &weights));
            assert!(largest_difference(&block, &expected) <= 1e-14 * size, "{} {count}", precision.name());
            assert_eq!(block, block.transpose());

            let whole = vec![0.3; everywhere.len()];
            let block = green.weighted_block(&everywhere, &whole, &columns, &weights);
            let (expected, size) = naive(&green, (&everywhere, &whole), (&nodes, &weights));
            assert!(largest_difference(&block, &expected) <= 1e-14 * size, "{} {count}", precision.name());
        }
    }
}

#[test]
fn a_gathered_block_holds_the_entries() {
    for precision in PRECISIONS {
        let green = body(3, precision);
        let (nodes, columns, _) = patch(&green, 7, 3);
        let rows: Vec<u32> = (0..green.surface_count() as u32).step_by(3).collect();
        let mut out = vec![0.0; 9 * rows.len() * nodes.len()];
        green.block(&rows, &columns, &mut out);
        for (j, &node) in nodes.iter().enumerate() {
            let rank = green.touch.binary_search(&node).expect("a touchable node");
            for (i, &row) in rows.iter().enumerate() {
                for (axis, k) in (0..9).map(|n| (n / 3, n % 3)) {
                    let copied = out[(3 * j + axis) * 3 * rows.len() + 3 * i + k];
                    assert_eq!(copied, green.entry(3 * row as usize + k, 3 * rank + axis));
                }
            }
        }
    }
}

#[test]
fn forces_move_the_surface_as_their_columns_do() {
    for precision in PRECISIONS {
        let green = body(4, precision);
        let (nodes, columns, _) = patch(&green, 21, 5);
        let mut random = Random(11);
        let forces: Vec<(TouchNode, DVec3)> =
            columns.iter().map(|&c| (c, DVec3::from(std::array::from_fn(|_| random.next() - 0.5)))).collect();
        let mut moved = vec![0.0; 3 * green.surface_count()];
        green.add_forces(&forces, &mut moved);
        let mut expected = vec![0.0; green.rows];
        for (&node, (_, force)) in nodes.iter().zip(&forces) {
            let rank = green.touch.binary_search(&node).expect("a touchable node");
            for axis in (0..3).filter(|axis| !green.row_is_fixed[3 * node as usize + axis]) {
                green.add_column(3 * rank + axis, force[axis], &mut expected);
            }
        }
        let size = expected.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for (row, u) in moved.iter().enumerate() {
            let wanted = if green.row_is_fixed[row] { 0.0 } else { expected[row] };
            assert!((u - wanted).abs() <= 1e-13 * size, "{} row {row}", precision.name());
        }
        // And a column is its entries.
        let mut column = vec![0.0; green.rows];
        green.add_column(4, 2.0, &mut column);
        for (row, value) in column.iter().enumerate() {
            assert!((value - 2.0 * green.entry(row, 4)).abs() <= 1e-15 * value.abs());
        }
    }
}

/// Shortest of some runs, microseconds.
fn microseconds(mut work: impl FnMut()) -> f64 {
    let time = |_| {
        let began = Instant::now();
        work();
        began.elapsed().as_secs_f64() * 1e6
    };
    (0..200).map(time).fold(f64::INFINITY, f64::min)
}

/// Run: cargo test --release -p palpate-core --test entries -- --ignored --nocapture
#[test]
#[ignore = "a measurement"]
fn cost_beside_a_plain_gather() {
    for precision in PRECISIONS {
        let mut problem = cube(20);
        problem.touch.retain(|_| true);
        let green = precompute(&problem, precision, &|_, _| true).expect("a supported body");
        let top = DVec3::new(0.051, 0.047, 0.1);
        let mut near = green.touch.clone();
        near.sort_by(|&a, &b| {
            let distance = |node: u32| green.surface.positions[node as usize].distance(top);
            distance(a).total_cmp(&distance(b))
        });
        for count in [15, 30, 100, 200] {
            let mut nodes = near[..count].to_vec();
            Random(1).shuffle(&mut nodes);
            let columns: Vec<TouchNode> = nodes.iter().filter_map(|&n| green.touchable(n as usize)).collect();
            let weights = vec![1.0 / count as f64; count];
            let mut out = vec![0.0; 9 * count * count];
            let gather = microseconds(|| green.block(&nodes, &columns, &mut out));
            let symmetric = microseconds(|| {
                std::hint::black_box(green.symmetric_block(&nodes, &columns, &weights));
            });
            let weighted = microseconds(|| {
                std::hint::black_box(green.weighted_block(&nodes, &weights, &columns, &weights));
            });
            let forces: Vec<(TouchNode, DVec3)> = columns.iter().map(|&c| (c, DVec3::ONE)).collect();
            let mut moved = vec![0.0; 3 * green.surface_count()];
            let frame = microseconds(|| green.add_forces(&forces, &mut moved));
            println!(
                "{} {count:4} nodes of {}: gather {gather:7.1} us, symmetric {symmetric:7.1} us, weighted {weighted:7.1} us, \
                 forces {frame:8.1} us",
                precision.name(),
                green.surface_count()
            );
        }
    }
}
