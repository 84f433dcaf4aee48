//! The whole content of an output.

use crate::run::Observer;
use foley_nodes::core::item::{AnyValue, StreamShape};
use foley_nodes::core::ports::PortKind;
use foley_nodes::core::time::{Tick, seconds};
use foley_nodes::io::{AudioReader, AudioWriter, WriteFormat, WriteSpec};
use serde_json::Value;
use std::io::Cursor;
use std::path::Path;

/// The whole content of an output.
#[derive(Clone, Debug, PartialEq)]
pub enum Recording {
    /// Audio.
    Sound(Samples),
    /// Another stream.
    Numbers(Samples),
    /// Events, each with its time in seconds.
    Events(Vec<(f64, Value)>),
    /// A value as JSON, and the hash of its content.
    Value(Value, String),
    /// A file that is no audio.
    Bytes(Vec<u8>),
    /// Nothing that can be read, and why.
    Nothing(String),
}

/// The numbers of a stream.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Items per second.
    pub rate: f64,
    /// Elements of an item: channels of audio.
    pub width: usize,
    /// Numbers of an item.
    pub numbers_per_item: usize,
    /// The numbers.
    pub numbers: Vec<f32>,
    /// Samples beyond full scale; of a file, as counted when it was written.
    pub clipped: u64,
}

impl Samples {
    /// Number of items.
    #[must_use]
    pub fn items(&self) -> usize {
        self.numbers.len() / self.numbers_per_item.max(1)
    }

    /// The numbers of the items that begin in a time, s.
    #[must_use]
    pub fn during(&self, [from, to]: [f64; 2]) -> &[f32] {
        let item = |time: f64| ((time * self.rate - 1e-6).ceil().max(0.0) as usize).min(self.items());
        let (from, to) = (item(from), item(to));
        &self.numbers[from * self.numbers_per_item..to.max(from) * self.numbers_per_item]
    }

    /// The mean of the channels.
    #[must_use]
    pub fn mono(numbers: &[f32], width: usize) -> Vec<f32> {
        let width = width.max(1);
        numbers.chunks_exact(width).map(|frame| frame.iter().sum::<f32>() / width as f32).collect()
    }

    /// A WAV file of 32-bit floats.
    ///
    /// # Errors
    /// If there is no such file format, as for thousands of channels.
    pub fn wav(&self) -> Result<Vec<u8>, String> {
        let mut file = Cursor::new(Vec::new());
        let spec = WriteSpec::new(self.rate.round() as u32, self.width, WriteFormat::Float32);
        let mut writer = AudioWriter::new(&mut file, spec).map_err(|e| e.to_string())?;
        writer.write(&self.numbers).map_err(|e| e.to_string())?;
        writer.finish().map_err(|e| e.to_string())?;
        Ok(file.into_inner())
    }
}

impl Recording {
    /// The content of a file: audio if its name says so.
    #[must_use]
    pub fn of_file(path: &Path, bytes: Vec<u8>, clipped: u64) -> Self {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        if !["wav", "flac", "ogg", "mp3"].contains(&ending.as_str()) {
            return Self::Bytes(bytes);
        }
        match read_audio(bytes) {
            Ok(samples) => Self::Sound(Samples { clipped, ..samples }),
            Err(e) => Self::Nothing(e),
        }
    }

    /// Hash of the content, hexadecimal: equal if and only if all numbers and times are, bit for bit.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        match self {
            Self::Sound(samples) | Self::Numbers(samples) => {
                hasher.update(&samples.rate.to_le_bytes()).update(&(samples.width as u64).to_le_bytes());
                let bytes: Vec<u8> = samples.numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
                hasher.update(&bytes);
            }
            Self::Events(events) => {
                for (time, event) in events {
                    hasher.update(&time.to_le_bytes()).update(event.to_string().as_bytes());
                }
            }
            Self::Value(_, hash) => {
                hasher.update(hash.as_bytes());
            }
            Self::Bytes(bytes) => {
                hasher.update(bytes);
            }
            Self::Nothing(reason) => {
                hasher.update(reason.as_bytes());
            }
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// In a word, for messages.
    #[must_use]
    pub fn describe(&self) -> &'static str {
        match self {
            Self::Sound(_) => "audio",
            Self::Numbers(_) => "a stream of numbers",
            Self::Events(_) => "events",
            Self::Value(..) => "a value",
            Self::Bytes(_) => "a file without audio",
            Self::Nothing(_) => "nothing",
        }
    }
}

/// Decodes an audio file.
///
/// # Errors
/// When it cannot be read.
pub fn read_audio(bytes: Vec<u8>) -> Result<Samples, String> {
    let mut reader = AudioReader::open(Box::new(Cursor::new(bytes))).map_err(|e| e.to_string())?;
    let (rate, width) = (f64::from(reader.info().rate), reader.info().channels);
    let mut numbers = vec![0.0; reader.info().frames as usize * width];
    let mut done = 0;
    while done < numbers.len() {
        match reader.read(&mut numbers[done..]).map_err(|e| e.to_string())? {
            0 => break,
            frames => done += frames * width,
        }
    }
    numbers.truncate(done);
    Ok(Samples { rate, width, numbers_per_item: width, numbers, clipped: 0 })
}

/// Collects an output of any type.
#[derive(Debug)]
pub struct Recorder(Option<Recording>);

impl Recorder {
    /// A recorder to which nothing has come.
    #[must_use]
    pub fn new() -> Self {
        Self(None)
    }

    /// The content so far.
    #[must_use]
    pub fn recording(&self) -> Recording {
        match &self.0 {
            Some(Recording::Sound(samples)) => {
                let clipped = samples.numbers.iter().filter(|x| x.abs() > 1.0).count() as u64;
                Recording::Sound(Samples { clipped, ..samples.clone() })
            }
            Some(recording) => recording.clone(),
            None => Recording::Nothing("the run ended before anything came".to_owned()),
        }
    }
}

impl Default for Recorder {
    fn default() -> Self {
        Self::new()
    }
}

impl Observer for Recorder {
    fn begin(&mut self, kind: PortKind, shape: Option<&StreamShape>) {
        let samples = shape.map(|shape| Samples {
            rate: shape.rate.as_f64(),
            width: shape.width,
            numbers_per_item: shape.width * shape.item.columns.len(),
            ..Samples::default()
        });
        let recording = match (kind, samples) {
            (PortKind::Stream(item), Some(samples)) if item.wave => Recording::Sound(samples),
            (PortKind::Stream(_), Some(samples)) => Recording::Numbers(samples),
            _ => Recording::Events(Vec::new()),
        };
        self.0 = Some(recording);
    }

    fn numbers(&mut self, _: i64, numbers: &[f32]) {
        if let Some(Recording::Sound(samples) | Recording::Numbers(samples)) = &mut self.0 {
            samples.numbers.extend_from_slice(numbers);
        }
    }

    fn events(&mut self, events: &[(Tick, Value)]) {
        if let Some(Recording::Events(all)) = &mut self.0 {
            all.extend(events.iter().map(|(at, event)| (seconds(*at), event.clone())));
        }
    }

    fn value(&mut self, value: &AnyValue) {
        let hash = value.hash().iter().map(|byte| format!("{byte:02x}")).collect();
        let json = serde_json::from_str(&value.json()).unwrap_or_default();
        self.0 = Some(Recording::Value(json, hash));
    }
}
