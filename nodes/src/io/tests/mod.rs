//! Tests of the readers, the writer and the nodes.

mod fuzz;
mod nodes;
mod packets;
mod wav;
mod write;

use std::io::Cursor;

use super::{AudioError, AudioInfo, AudioReader};

pub const FLAC: &[u8] = include_bytes!("../../../tests/data/tone_22050_1.flac");
pub const FLAC_24: &[u8] = include_bytes!("../../../tests/data/tone_48000_1_24bit.flac");
pub const OGG: &[u8] = include_bytes!("../../../tests/data/tone_22050_1.ogg");
pub const OGG_STEREO: &[u8] = include_bytes!("../../../tests/data/tone_44100_2.ogg");
pub const OGG_LONG: &[u8] = include_bytes!("../../../tests/data/long_44100_2.ogg");
pub const MP3: &[u8] = include_bytes!("../../../tests/data/tone_22050_1.mp3");
pub const MP3_STEREO: &[u8] = include_bytes!("../../../tests/data/tone_44100_2.mp3");
pub const MP3_UNTAGGED: &[u8] = include_bytes!("../../../tests/data/untagged_22050_1.mp3");

pub fn open(bytes: &[u8]) -> Result<AudioReader<'_>, AudioError> {
    AudioReader::open(Box::new(Cursor::new(bytes)))
}

/// All samples of a file, read in blocks of `block` frames.
pub fn read_all(bytes: &[u8], block: usize) -> Result<(AudioInfo, Vec<f32>), AudioError> {
    let mut reader = open(bytes)?;
    let mut samples = Vec::new();
    let mut out = vec![f32::NAN; block * reader.info().channels];
    loop {
        let n = reader.read(&mut out)?;
        if n == 0 {
            break;
        }
        samples.extend_from_slice(&out[..n * reader.info().channels]);
    }
    assert_eq!(samples.len() as u64, reader.info().frames * reader.info().channels as u64);
    Ok((reader.info().clone(), samples))
}

/// Maximum difference between a channel and the sine of the test files.
pub fn tone_error(samples: &[f32], channels: usize, channel: usize, rate: f64) -> f64 {
    let step = std::f64::consts::TAU * 1000.0 * (channel + 1) as f64 / rate;
    let gain = 10_f64.powf(-0.3);
    let frames = samples.iter().skip(channel).step_by(channels).enumerate();
    frames.map(|(n, &x)| (f64::from(x) - gain * (step * n as f64).sin()).abs()).fold(0.0, f64::max)
}
