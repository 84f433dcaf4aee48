//! Status of a device that plays.

use std::sync::atomic::{AtomicBool, AtomicU64};

/// Late windows and loss of a device.
#[derive(Debug, Default)]
pub struct DeviceStatus {
    /// Windows that began after the end of the one before.
    pub late: AtomicU64,
    /// True if the device is gone.
    pub lost: AtomicBool,
}
