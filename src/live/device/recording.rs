//! The file of the device `file:PATH`, written by a thread of its own, in whole windows, and complete up to its end.

use super::timing::DeviceStatus;
use crate::live::playback::callback::Callback;
use crate::run::DirOutputs;
use foley_nodes::io::{AudioWriter, WriteFormat, WriteSpec};
use rtrb::{Consumer, Producer, RingBuffer};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

/// Interval between two looks of the writer at the ring.
const WRITE_INTERVAL: Duration = Duration::from_millis(20);
/// Time for which a clock that is behind waits for the writer.
const WAIT: Duration = Duration::from_millis(100);
/// Time that the ring has room for, s.
const ROOM: f64 = 2.0;

/// The end of a recording at the clock.
pub struct RecordingSender {
    ring: Producer<f32>,
    writer: Thread,
    status: Arc<DeviceStatus>,
}

impl RecordingSender {
    /// Records a window, or counts it as lost: all of it or nothing. `late` if the clock is behind, so that it may wait.
    pub fn send(&mut self, block: &[f32], late: bool) {
        let start = Instant::now();
        while late && self.ring.slots() < block.len() && !self.ring.is_abandoned() && start.elapsed() < WAIT {
            self.writer.unpark();
            std::thread::sleep(Duration::from_millis(1));
        }
        match self.ring.write_chunk_uninit(block.len()) {
            Ok(chunk) => drop(chunk.fill_from_iter(block.iter().copied())),
            Err(_) => {
                self.status.lost_windows.fetch_add(1, Relaxed);
            }
        }
    }
}

/// A recording: the end at the clock, and the thread that writes.
pub type Recording = (RecordingSender, JoinHandle<Result<(), String>>);

/// Starts a thread that writes the samples of a clock to a file, which is renamed when it is complete.
///
/// # Errors
/// When the file cannot be made.
pub fn start_recording(
    path: &Path,
    callback: &Callback,
    status: &Arc<DeviceStatus>,
) -> Result<Recording, String> {
    let (rate, channels) = (callback.rate(), callback.channels());
    let outputs = DirOutputs::new(".");
    // Without a buffer, so that what a full disk has refused is not tried again.
    let file = outputs.create_file_at(path).map_err(|e| e.message)?;
    let spec = WriteSpec::new(rate.num() as u32, channels, WriteFormat::Float32);
    let writer = AudioWriter::new(file, spec).map_err(|e| e.to_string())?;
    let room = (ROOM * rate.as_f64()) as usize * channels;
    let (ring, samples) = RingBuffer::new(room.max(4 * callback.quantum() * channels));
    let (name, reported) = (path.display().to_string(), Arc::clone(status));
    let thread = std::thread::spawn(move || write(writer, samples, channels, &name, &reported, &outputs));
    let sender = RecordingSender { ring, writer: thread.thread().clone(), status: Arc::clone(status) };
    Ok((sender, thread))
}

/// Writes all samples. When the disk refuses some, the failure is reported at once, and the file ends with the samples so far.
fn write(
    mut writer: AudioWriter<File>,
    mut samples: Consumer<f32>,
    channels: usize,
    name: &str,
    status: &DeviceStatus,
    outputs: &DirOutputs,
) -> Result<(), String> {
    let mut block = Vec::new();
    loop {
        let last = samples.is_abandoned();
        let n = samples.slots() / channels * channels;
        if let Ok(chunk) = samples.read_chunk(n) {
            block.clear();
            block.extend(chunk);
            if let Err(e) = writer.write(&block) {
                drop(samples);
                let written = writer.finish_cut().map_err(|e| format!("cannot write {name}: {e}"))?;
                outputs.commit().map_err(|e| e.to_string())?;
                let seconds = written.frames as f64 / f64::from(written.rate);
                status.fail(format!(
                    "the recording ends: cannot write {name}: {e}; {seconds:.2} s are in the file"
                ));
                return Ok(());
            }
        }
        if last {
            break;
        }
        std::thread::park_timeout(WRITE_INTERVAL);
    }
    writer.finish().map_err(|e| format!("cannot write {name}: {e}"))?;
    outputs.commit().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_recorded_as_a_whole_or_lost_and_counted() {
        let status = Arc::new(DeviceStatus::default());
        let (ring, mut samples) = RingBuffer::new(300);
        let writer = std::thread::current();
        let mut sender = RecordingSender { ring, writer, status: Arc::clone(&status) };
        for (k, late) in [(1.0, false), (2.0, false), (3.0, false), (4.0, true)] {
            sender.send(&[k; 128], late);
        }
        assert_eq!((samples.slots(), status.lost_windows.load(Relaxed)), (256, 2));
        assert!(
            samples
                .read_chunk(256)
                .unwrap()
                .into_iter()
                .enumerate()
                .all(|(k, x)| x == 1.0 + (k / 128) as f32)
        );
    }
}
