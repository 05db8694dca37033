//! Priority of the threads of emulators and their tests.

use thread_priority::unix::{
    RealtimeThreadSchedulePolicy::Fifo, ThreadSchedulePolicy::Realtime, set_thread_priority_and_policy,
    thread_native_id,
};

/// Real-time scheduling of the calling thread where the system grants it: on a busy machine too, what a test sees late is late by
/// the driver. Below the priorities that loops and drivers ask for.
pub fn request_realtime() {
    let lowest = thread_priority::ThreadPriority::Min;
    let _ = set_thread_priority_and_policy(thread_native_id(), lowest, Realtime(Fifo));
}
