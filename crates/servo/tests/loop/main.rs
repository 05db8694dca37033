//! The force loop as its users see it, in one program: linking each file alone took longer than running it.
#![allow(unsafe_code)] // a counting allocator

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../core/tests/common/counting_allocator.rs"]
mod counting_allocator;

mod change;
mod faults;
mod force_loop;
mod lift_off;
mod no_allocation;
mod passivity;
mod replay;
mod series;
mod sliding;
mod strikes;
mod z_width;
