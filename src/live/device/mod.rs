//! Audio devices: a clock without sound, a file that is written in real time, or a sound card (feature `live`).

#[cfg(feature = "live")]
mod sound_card;
mod timing;

pub use timing::DeviceStatus;

use super::playback::callback::Callback;
use crate::run::DirOutputs;
use foley_nodes::io::{AudioWriter, WriteFormat, WriteSpec};
use rtrb::RingBuffer;
use std::path::{Path, PathBuf};
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
        Device::Null => Ok(start_clock(callback, None)),
        Device::File(path) => match start_writer(path, &callback) {
            Ok((ring, thread)) => {
                let mut running = start_clock(callback, Some(ring));
                running.writer = Some(thread);
                Ok(running)
            }
            Err(e) => Err((Box::new(callback), e)),
        },
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

/// Starts a thread that computes one window per window length, and writes it to a ring.
fn start_clock(mut callback: Callback, mut ring: Option<rtrb::Producer<f32>>) -> Running {
    let (stop, status) = (Arc::new(AtomicBool::new(false)), Arc::new(DeviceStatus::default()));
    let (stopped, clock) = (Arc::clone(&stop), Arc::clone(&status));
    let thread = std::thread::spawn(move || {
        let (frames, rate) = (callback.quantum(), callback.rate().as_f64());
        let mut block = vec![0.0; frames * callback.channels()];
        let start = Instant::now();
        let mut window = 0_u64;
        while !stopped.load(Relaxed) {
            callback.fill(&mut block);
            if let Some(ring) = &mut ring {
                // Samples that do not fit are lost: a slow disk must not stop the clock.
                for x in &block {
                    let _ = ring.push(*x);
                }
            }
            window += 1;
            let due = Duration::from_secs_f64(window as f64 * frames as f64 / rate);
            match due.checked_sub(start.elapsed()) {
                Some(wait) => std::thread::sleep(wait),
                None => {
                    clock.late.fetch_add(1, Relaxed);
                }
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

/// Samples to a writer thread, and the thread.
type FileWriter = (rtrb::Producer<f32>, JoinHandle<Result<(), String>>);

/// Starts a thread that writes the samples of a clock to a file, which is renamed when it is complete.
fn start_writer(path: &Path, callback: &Callback) -> Result<FileWriter, String> {
    let (rate, channels) = (callback.rate(), callback.channels());
    let outputs = DirOutputs::new(".");
    let file = outputs.create_at(path).map_err(|e| e.message)?;
    let spec = WriteSpec::new(rate.num() as u32, channels, WriteFormat::Float32);
    let mut writer = AudioWriter::new(file, spec).map_err(|e| e.to_string())?;
    // Room for two seconds.
    let (ring, mut samples) = RingBuffer::<f32>::new(2 * rate.num() as usize * channels);
    let thread = std::thread::spawn(move || {
        let mut block = Vec::new();
        loop {
            let last = samples.is_abandoned();
            let n = samples.slots() / channels * channels;
            if let Ok(chunk) = samples.read_chunk(n) {
                block.clear();
                block.extend(chunk);
                writer.write(&block).map_err(|e| e.to_string())?;
            }
            if last {
                break;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        writer.finish().map_err(|e| e.to_string())?;
        outputs.commit().map_err(|e| e.to_string())
    });
    Ok((ring, thread))
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
