//! Subnormal numbers are zero within a tick.
//!
//! A decaying motion ends in subnormal numbers, with which each operation takes a hundred times as long on many
//! processors. Whether they are flushed is a mode of the thread, and a driver's thread may have either: the tick sets the
//! mode and gives it back, so that its time is bounded and its bits are the same on every thread. The compiler knows nothing
//! of it and computes constants without; that is the same in every run of the same program.
#![allow(unsafe_code)] // the register has no safe interface

/// Flushes subnormal inputs and results to zero until dropped.
pub struct FlushSubnormals {
    saved: Register,
}

impl FlushSubnormals {
    /// Begins.
    pub fn begin() -> Self {
        let saved = read();
        write(saved | FLUSH);
        Self { saved }
    }
}

impl Drop for FlushSubnormals {
    fn drop(&mut self) {
        write(self.saved);
    }
}

#[cfg(target_arch = "x86_64")]
mod register {
    pub type Register = u32;
    /// MXCSR: results (bit 15) and inputs (bit 6).
    pub const FLUSH: Register = 1 << 15 | 1 << 6;

    pub fn read() -> Register {
        let mut value = 0;
        // SAFETY: stores the control and status register of the vector unit into a valid u32.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &mut value, options(nostack)) };
        value
    }

    pub fn write(value: Register) {
        // SAFETY: loads a value that was read there, with two defined bits changed; no exception is unmasked.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &value, options(nostack)) };
    }
}

#[cfg(target_arch = "aarch64")]
mod register {
    pub type Register = u64;
    /// FPCR: FZ (bit 24), inputs and results.
    pub const FLUSH: Register = 1 << 24;

    pub fn read() -> Register {
        let value;
        // SAFETY: reads the floating-point control register.
        unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) value, options(nostack)) };
        value
    }

    pub fn write(value: Register) {
        // SAFETY: writes a value that was read there, with one defined bit changed.
        unsafe { std::arch::asm!("msr fpcr, {}", in(reg) value, options(nostack)) };
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod register {
    pub type Register = ();
    compile_error!("say how this processor flushes subnormal numbers");
}

use register::{FLUSH, Register, read, write};

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    use super::*;

    /// Half of the smallest normal number, and a subnormal input doubled.
    #[inline(never)]
    fn subnormals() -> [f64; 2] {
        [black_box(f64::MIN_POSITIVE) * black_box(0.5), black_box(f64::from_bits(1 << 51)) * black_box(2.0)]
    }

    #[test]
    fn are_zero_within_and_themselves_again_after() {
        assert_eq!(subnormals(), [0.5 * f64::MIN_POSITIVE, f64::MIN_POSITIVE]);
        {
            let _flush = FlushSubnormals::begin();
            assert_eq!(subnormals().map(f64::to_bits), [0, 0]);
        }
        assert_eq!(subnormals(), [0.5 * f64::MIN_POSITIVE, f64::MIN_POSITIVE]);
    }
}
