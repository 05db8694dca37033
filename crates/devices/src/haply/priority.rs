//! Priority of the driver's thread.

/// Asks for real-time scheduling (`SCHED_FIFO`), as the loop does for its own thread. Without it the thread works as well, on a
/// machine that is not busy.
#[cfg(unix)]
pub fn raise() {
    use thread_priority::unix::{
        RealtimeThreadSchedulePolicy::Fifo, ThreadSchedulePolicy::Realtime, set_thread_priority_and_policy,
        thread_native_id,
    };
    /// Above that of the loop by default, 80: the loop waits for what the thread brings, which takes it some microseconds of
    /// each exchange.
    const PRIORITY: u8 = 81;
    let Ok(priority) = PRIORITY.try_into() else { return };
    let wanted = thread_priority::ThreadPriority::Crossplatform(priority);
    let _ = set_thread_priority_and_policy(thread_native_id(), wanted, Realtime(Fifo));
}

/// Asks for the highest priority of the process.
#[cfg(not(unix))]
pub fn raise() {
    let _ = thread_priority::set_current_thread_priority(thread_priority::ThreadPriority::Max);
}
