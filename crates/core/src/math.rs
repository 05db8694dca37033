//! Functions beyond IEEE arithmetic and the square root, from one library on every platform.
//!
//! The system's `ln`, `exp` or `sin` differ in the last digit from one system to the next, and WebAssembly has none of its
//! own. A tick, and what it is prepared from, calls these instead: the same input gives the same bits in a program and in a
//! browser.

pub(crate) use libm::{acos, asin, atan2, atanh, cbrt, cos, exp, expm1, hypot, log, log2, pow, sin, sincos, tan, tanh};

/// Sum of eight numbers in the order of a processor's vector registers.
#[inline(always)]
pub(crate) fn sum_lanes([a, b, c, d, e, f, g, h]: [f64; 8]) -> f64 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
