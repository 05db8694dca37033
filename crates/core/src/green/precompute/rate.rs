//! Matrix products like those of a precomputation, to measure the speed of a machine.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use super::number::Number;

/// Sides of the product: those of a large node of the tree with a block of columns.
const SIZE: usize = 384;
const WIDTH: usize = 192;

/// Multiplies matrices `count` times on every thread at once, in single precision or in double; returns the number of operations.
pub fn products(single: bool, count: usize) -> f64 {
    let threads = rayon::broadcast(|_| if single { multiply::<f32>(count) } else { multiply::<f64>(count) });
    2.0 * (SIZE * SIZE * WIDTH * count * threads.len()) as f64
}

fn multiply<C: Number>(count: usize) {
    let fill = |i: usize, j: usize| C::from_f64(1.0 / (1 + i + j) as f64);
    let (a, b) = (Mat::from_fn(SIZE, SIZE, fill), Mat::from_fn(SIZE, WIDTH, fill));
    let mut product = Mat::from_fn(SIZE, WIDTH, fill);
    for _ in 0..count {
        matmul(product.as_mut(), Accum::Replace, a.as_ref(), b.as_ref(), C::from_f64(1.0), Par::Seq);
        std::hint::black_box(&product);
    }
}
