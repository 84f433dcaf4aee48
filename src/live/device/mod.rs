//! Audio devices: a clock without sound, a file that is written in real time, or a sound card (feature `live`).

mod recording;
#[cfg(feature = "live")]
mod sound_card;
mod timing;

pub use timing::DeviceStatus;

use super::playback::callback::Callback;
use recording::{RecordingSender, start_recording};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// A clock: everything runs as with a card, without sound.
    Null,
    /// A WAV file, written in real time.
    File(PathBuf),
    /// A sound card by name, or the default one.
    Card(Option<String>),
}

impl Device {
    /// Parses `null`, `file:PATH` or the name of a card.
    #[must_use]
    pub fn parse(text: Option<&str>) -> Self {
        match text {
            None if cfg!(feature = "live") => Self::Card(None),
            None | Some("null") => Self::Null,
            Some(text) => match text.strip_prefix("file:") {
                Some(path) => Self::File(path.into()),
                None => Self::Card(Some(text.to_owned())),
            },
        }
    }
}

/// A device that plays.
pub struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Callback>>,
    writer: Option<JoinHandle<Result<(), String>>>,
    #[cfg(feature = "live")]
    card: Option<sound_card::SoundCard>,
    /// Its status.
    pub status: Arc<DeviceStatus>,
}

/// Starts a device.
///
/// # Errors
/// The message of the system about a card or file that cannot be opened, with the callback.
pub fn start(device: &Device, callback: Callback) -> Result<Running, (Box<Callback>, String)> {
    match device {
        Device::Null => Ok(start_clock(callback, None, Arc::default())),
        Device::File(path) => {
            let status = Arc::default();
            match start_recording(path, &callback, &status) {
                Ok((sender, thread)) => {
                    let mut running = start_clock(callback, Some(sender), status);
                    running.writer = Some(thread);
                    Ok(running)
                }
                Err(e) => Err((Box::new(callback), e)),
            }
        }
        #[cfg(feature = "live")]
        Device::Card(name) => sound_card::start(name.as_deref(), callback).map(|(card, status)| Running {
            stop: Arc::default(),
            thread: None,
            writer: None,
            card: Some(card),
            status,
        }),
        #[cfg(not(feature = "live"))]
        Device::Card(name) => {
            let name = name.as_deref().unwrap_or("the default one");
            let text = format!(
                "this build has no sound cards ({name}): build it with `--features live`, or take `null` or `file:PATH`"
            );
            Err((Box::new(callback), text))
        }
    }
}

/// Time by which a clock catches up at most: if it stood still for longer, it continues from now.
const CATCH_UP: Duration = Duration::from_millis(500);

/// Starts a thread that computes one window per window length, and records it.
fn start_clock(
    mut callback: Callback,
    mut recording: Option<RecordingSender>,
    status: Arc<DeviceStatus>,
) -> Running {
    let stop = Arc::new(AtomicBool::new(false));
    let (stopped, clock) = (Arc::clone(&stop), Arc::clone(&status));
    let thread = std::thread::spawn(move || {
        let (frames, rate) = (callback.quantum(), callback.rate().as_f64());
        let mut block = vec![0.0; frames * callback.channels()];
        let mut start = Instant::now();
        let (mut window, mut late) = (0_u64, false);
        while !stopped.load(Relaxed) {
            callback.fill(&mut block);
            if let Some(recording) = &mut recording {
                recording.send(&block, late);
            }
            window += 1;
            let due = Duration::from_secs_f64(window as f64 * frames as f64 / rate);
            let elapsed = start.elapsed();
            late = elapsed > due;
            if late {
                clock.late.fetch_add(1, Relaxed);
                let behind = elapsed - due;
                // The nodes ahead of the callback have stood still as well: in a burst, they would miss all of it.
                if behind > CATCH_UP {
                    start += behind;
                    clock.stopped_ms.fetch_add(behind.as_millis() as u64, Relaxed);
                }
            } else {
                std::thread::sleep(due - elapsed);
            }
        }
        callback
    });
    Running {
        stop,
        thread: Some(thread),
        writer: None,
        #[cfg(feature = "live")]
        card: None,
        status,
    }
}

impl Running {
    /// Returns true if the device is gone.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.status.lost.load(Relaxed)
    }

    /// Stops the device and returns the callback.
    ///
    /// # Errors
    /// When the file could not be written.
    pub fn stop(mut self) -> Result<Option<Callback>, String> {
        self.stop.store(true, Relaxed);
        #[cfg(feature = "live")]
        if let Some(card) = self.card.take() {
            return Ok(card.stop());
        }
        let callback = self.thread.take().and_then(|thread| thread.join().ok());
        match self.writer.take().map(JoinHandle::join) {
            None | Some(Ok(Ok(()))) => Ok(callback),
            Some(Ok(Err(e))) => Err(e),
            Some(Err(_)) => Err("the writer of the file panicked".to_owned()),
        }
    }
}
