//! Status of a device that plays.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// Late windows, gaps, and loss of a device.
#[derive(Debug, Default)]
pub struct DeviceStatus {
    /// Windows that began after the end of the one before.
    pub late: AtomicU64,
    /// Windows of sound that are missing in the file.
    pub lost_windows: AtomicU64,
    /// Milliseconds for which the clock stood still, since the process was stopped or the machine slept.
    pub stopped_ms: AtomicU64,
    /// True if the device is gone.
    pub lost: AtomicBool,
    /// True if the file ends before the sound.
    pub cut: AtomicBool,
    failure: Mutex<Option<String>>,
}

impl DeviceStatus {
    /// Reports that the file ends before the sound.
    pub(super) fn fail(&self, message: String) {
        self.cut.store(true, Relaxed);
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
    }

    /// Takes the reason why the file has ended before the sound.
    pub fn take_failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
