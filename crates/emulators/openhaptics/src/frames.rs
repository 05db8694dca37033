//! Frames.

use crate::scheduler;
use crate::{may_call, world};

#[unsafe(no_mangle)]
pub extern "system" fn hdBeginFrame(handle: u32) {
    if !may_call() {
        return;
    }
    let tick = scheduler::tick();
    let mut world = world();
    if let Some(begun) = world.find(handle).map(|device| device.begin(tick)) {
        world.current = handle;
        if let Err(code) = begun {
            world.raise(code, handle);
        }
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdEndFrame(handle: u32) {
    if !may_call() {
        return;
    }
    let period = scheduler::period();
    let mut world = world();
    if let Some(Err(code)) = world.find(handle).map(|device| device.end(period)) {
        world.raise(code, handle);
    }
}
