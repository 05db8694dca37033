//! Priority of the driver's thread.

/// Above that of the loop by default, 80: the loop waits for what the thread brings, which takes it some microseconds of each
/// exchange.
const PRIORITY: u8 = 81;

/// Asks for real-time scheduling (`SCHED_FIFO`), as the loop does for its own thread. Without it the thread works as well, on a
/// machine that is not busy.
pub fn raise() {
    use thread_priority::unix::{
        RealtimeThreadSchedulePolicy::Fifo, ThreadSchedulePolicy::Realtime, set_thread_priority_and_policy,
        thread_native_id,
    };
    let Ok(priority) = PRIORITY.try_into() else { return };
    let wanted = thread_priority::ThreadPriority::Crossplatform(priority);
    let _ = set_thread_priority_and_policy(thread_native_id(), wanted, Realtime(Fifo));
}
