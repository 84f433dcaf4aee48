//! What takes the sound: a clock without a card, a file that fills as it plays, or a sound card (feature `live`).

use super::callback::Callback;
use crate::run::DirOutputs;
use foley_nodes::io::{AudioWriter, WriteFormat, WriteSpec};
use rtrb::RingBuffer;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Which device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// A clock: everything runs as with a card, and nobody hears it.
    Null,
    /// A WAV file, written in real time.
    File(PathBuf),
    /// A sound card by name, or the usual one.
    Card(Option<String>),
}

impl Device {
    /// Reads `null`, `file:PATH` or the name of a card.
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

/// How punctual a clock was.
#[derive(Debug, Default)]
pub struct Punctuality {
    /// Windows that began later than the sound before them lasted.
    pub late: AtomicU64,
    /// Whether the device is gone.
    pub lost: AtomicBool,
}

/// A device that plays.
pub struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Callback>>,
    writer: Option<JoinHandle<Result<(), String>>>,
    #[cfg(feature = "live")]
    card: Option<super::card::Card>,
    /// How punctual it is.
    pub punctuality: Arc<Punctuality>,
}

/// Starts a device.
///
/// # Errors
/// What the system says of a card or file that cannot be had; the callback comes back with it.
pub fn start(device: &Device, callback: Callback) -> Result<Running, (Box<Callback>, String)> {
    match device {
        Device::Null => Ok(paced(callback, None)),
        Device::File(path) => match writer(path, &callback) {
            Ok((ring, thread)) => {
                let mut running = paced(callback, Some(ring));
                running.writer = Some(thread);
                Ok(running)
            }
            Err(e) => Err((Box::new(callback), e)),
        },
        #[cfg(feature = "live")]
        Device::Card(name) => super::card::start(name.as_deref(), callback).map(|(card, punctuality)| {
            Running { stop: Arc::default(), thread: None, writer: None, card: Some(card), punctuality }
        }),
        #[cfg(not(feature = "live"))]
        Device::Card(name) => {
            let name = name.as_deref().unwrap_or("the usual one");
            let text = format!(
                "this build has no sound cards ({name}): build it with `--features live`, or take `null` or `file:PATH`"
            );
            Err((Box::new(callback), text))
        }
    }
}

/// A thread that asks for one window whenever the one before it would have been played.
fn paced(mut callback: Callback, mut ring: Option<rtrb::Producer<f32>>) -> Running {
    let (stop, punctuality) = (Arc::new(AtomicBool::new(false)), Arc::new(Punctuality::default()));
    let (stopped, clock) = (Arc::clone(&stop), Arc::clone(&punctuality));
    let thread = std::thread::spawn(move || {
        let (frames, rate) = (callback.quantum(), callback.rate().as_f64());
        let mut block = vec![0.0; frames * callback.channels()];
        let start = Instant::now();
        let mut window = 0_u64;
        while !stopped.load(Relaxed) {
            callback.fill(&mut block);
            if let Some(ring) = &mut ring {
                // What does not fit is lost, as with a card: a disk must not stop the clock.
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
        punctuality,
    }
}

type Ring = (rtrb::Producer<f32>, JoinHandle<Result<(), String>>);

/// A thread that writes what the clock plays; the file gets its name when it is whole.
fn writer(path: &Path, callback: &Callback) -> Result<Ring, String> {
    let (rate, channels) = (callback.rate(), callback.channels());
    let outputs = DirOutputs::new(".");
    let file = outputs.create_at(path).map_err(|e| e.message)?;
    let spec = WriteSpec::new(rate.num() as u32, channels, WriteFormat::Float32);
    let mut writer = AudioWriter::new(file, spec).map_err(|e| e.to_string())?;
    // Two seconds of room.
    let (ring, mut full) = RingBuffer::<f32>::new(2 * rate.num() as usize * channels);
    let thread = std::thread::spawn(move || {
        let mut block = Vec::new();
        loop {
            let last = full.is_abandoned();
            let n = full.slots() / channels * channels;
            if let Ok(chunk) = full.read_chunk(n) {
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
    /// Whether the device is gone.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.punctuality.lost.load(Relaxed)
    }

    /// Ends, and gives the callback back.
    ///
    /// # Errors
    /// When what was played could not be written.
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
