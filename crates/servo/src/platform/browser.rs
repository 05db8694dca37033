//! WebAssembly: the page's clock. There is one thread, and nothing waits.
#![allow(unsafe_code)] // a function of the page

#[link(wasm_import_module = "palpate")]
unsafe extern "C" {
    /// Milliseconds of the page's monotonic clock.
    safe fn now_ms() -> f64;
}

/// Nanoseconds of the monotonic clock.
pub fn now_ns() -> u64 {
    (1e6 * now_ms()) as u64
}

/// Nanoseconds that have passed.
pub fn computed_ns() -> u64 {
    now_ns()
}

/// The page calls the ticks that are due: nothing waits here.
pub fn sleep_until_ns(_deadline: u64) {}
