//! Recordings that nodes load as a whole: checks, warnings and trial files.

use super::{AudioInfo, AudioReader, AudioWriter, ReadSeek, WriteFormat, WriteSpec};
use crate::core::fault::{Fault, Reject};
use crate::core::node::Summary;
use crate::core::params::AssetPath;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::dsp::{DspError, Quality, Resampler};
use std::fmt::Display;

/// Greatest length of a recording that a node loads.
pub(crate) enum MaxLength {
    /// Frames at any rate.
    Frames(u64),
    /// Seconds at the rate of the recording.
    Seconds(u64),
}

/// A recording that was read as a whole.
pub(crate) struct Whole {
    /// Its channels, resampled.
    pub channels: Vec<Vec<f32>>,
    /// Its own samples, interleaved.
    pub samples: Vec<f32>,
    /// Properties of the file.
    pub info: AudioInfo,
}

/// A parameter with paths of recordings that a node loads as a whole.
pub(crate) struct RecordingParam {
    /// Its name.
    pub name: &'static str,
    /// Code of the diagnostics about its recordings.
    pub code: &'static str,
    /// Longest recording.
    pub max: MaxLength,
}

impl RecordingParam {
    /// An error about one recording.
    pub(crate) fn unusable(&self, path: &str, problem: impl Display) -> Reject {
        Reject::new(self.code, format!("{path:?}: {problem}")).at(self.name)
    }

    /// Opens a recording.
    ///
    /// # Errors
    /// A file that is no audio, or is too long.
    pub(crate) fn open<'a>(
        &self,
        path: &str,
        file: Box<dyn ReadSeek + 'a>,
    ) -> Result<AudioReader<'a>, Reject> {
        let reader = AudioReader::open(Box::new(file)).map_err(|e| self.unusable(path, e))?;
        let frames = reader.info().frames;
        let (max, reason) = match self.max {
            MaxLength::Frames(max) => (max, String::new()),
            MaxLength::Seconds(max) => (max * u64::from(reader.info().rate), format!(" ({max} s)")),
        };
        if frames > max {
            let reject = self.unusable(path, format!("{frames} frames; at most {max}{reason} are read"));
            return Err(reject.help("cut it into shorter files"));
        }
        Ok(reader)
    }

    /// Reads a recording as a whole, with its channels averaged, and its properties.
    ///
    /// # Errors
    /// A file that is no audio, is too long, or holds a sample that is not finite.
    pub(crate) fn read_mono(&self, cx: &Build<'_>, path: &str) -> Result<(Vec<f32>, AudioInfo), Fault> {
        let mut reader = self.open(path, cx.open(self.name, path)?)?;
        let samples = reader.read_mono().map_err(|e| self.unusable(path, e))?;
        if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
            return Err(self.unusable(path, format!("sample {index} is not finite")).into());
        }
        Ok((samples, reader.info().clone()))
    }

    /// Reads a recording with all its channels, and resamples it.
    ///
    /// # Errors
    /// A file that is no audio, is too long, is empty, or holds a sample that is not finite.
    pub(crate) fn read_whole(
        &self,
        cx: &Build<'_>,
        field: &str,
        path: &str,
        rate: Rate,
    ) -> Result<Whole, Fault> {
        let wrong = |text: String| self.unusable(path, text).at(field);
        let mut reader = self.open(path, cx.open(field, path)?)?;
        let info = reader.info().clone();
        let channels = info.channels.max(1);
        let mut samples = vec![0.0; info.frames as usize * channels];
        let frames = reader.read(&mut samples).map_err(|e| wrong(e.to_string()))?;
        samples.truncate(frames * channels);
        if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
            return Err(wrong(format!("sample {} is not finite", index / channels)).into());
        }
        if samples.is_empty() {
            return Err(wrong("it has no sample".into()).help("leave it out").into());
        }
        let own = Rate::new(u64::from(info.rate), 1).ok_or_else(|| wrong("its rate is 0".into()))?;
        let of_channel = |c: usize| samples.iter().skip(c).step_by(channels).copied().collect::<Vec<f32>>();
        let at_rate = |x: Vec<f32>| match own == rate {
            true => Ok(x),
            false => Resampler::new(own, rate, Quality::High)?.whole(&x),
        };
        let resampled: Result<Vec<Vec<f32>>, DspError> = (0..channels).map(of_channel).map(at_rate).collect();
        Ok(Whole { channels: resampled.map_err(|e| wrong(e.to_string()))?, samples, info })
    }

    /// Checks a list of recordings: reports errors, notes warnings and reserves memory.
    pub(crate) fn check<P>(&self, s: &mut Shape<'_, '_, P>, paths: &[AssetPath]) {
        for (k, AssetPath(path)) in paths.iter().enumerate() {
            if !self.check_one(s, &format!("{}[{k}]", self.name), path) {
                break;
            }
        }
    }

    /// Checks a recording that `field` names, as [`Self::check`]; returns false if the memory limit is reached, which the following
    /// recordings would exceed too.
    pub(crate) fn check_one<P>(&self, s: &mut Shape<'_, '_, P>, field: &str, path: &str) -> bool {
        let opened = s.open(field, path).and_then(|file| Ok(self.open(path, file)?.info().clone()));
        let Some(info) = s.check(opened.map_err(|reject| reject.at(field))) else { return true };
        let reserved = s.hold(field, path, info.analysis_bytes());
        if s.check(reserved).is_none() {
            return false;
        }
        info.warning_texts(path).for_each(|text| s.note(text));
        true
    }
}

/// Bytes of a mono WAV for trials of nodes that read one; empty if it cannot be written.
pub(crate) fn trial_wav(samples: &[f32], rate: u32) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let spec = WriteSpec::new(rate, 1, WriteFormat::Float32);
    let written = AudioWriter::new(&mut file, spec).and_then(|mut writer| {
        writer.write(samples)?;
        writer.finish()
    });
    if written.is_ok() { file.into_inner() } else { Vec::new() }
}

/// Fraction of the power of a recording in its mean above which a warning appears.
const MAX_DC_FRACTION: f64 = 0.1;

/// Warnings about a recording that has been read: corrupt packets, and a constant offset.
pub(crate) fn recording_warnings(path: &str, info: &AudioInfo, samples: &[f32]) -> Summary {
    let n = samples.len().max(1) as f64;
    let mean = samples.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
    let power = samples.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() / n;
    let dc_fraction = if power > 0.0 { mean * mean / power } else { 0.0 };
    let offset = (dc_fraction > MAX_DC_FRACTION).then(|| {
        let percent = 100.0 * dc_fraction;
        format!(
            "{path:?}: {percent:.0} % of the power is a constant offset of {mean:.3}, which is inaudible but distorts every analysis: \
             remove the DC offset first"
        )
    });
    let corrupt = info.corrupt_packets().map(|warning| format!("{path:?}: {warning}"));
    corrupt.into_iter().chain(offset).map(|text| ("warning", text.into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{AudioWarning, FileFormat, SampleFormat};

    #[test]
    fn a_constant_offset_and_corrupt_packets_are_warnings() {
        let info = AudioInfo {
            format: FileFormat::Flac,
            rate: 8000,
            channels: 1,
            frames: 4,
            sample_format: SampleFormat::Int { bits: 16 },
            channel_mask: None,
            warnings: vec![AudioWarning::NoEnd],
        };
        let texts = |info: &AudioInfo, samples: &[f32]| -> Vec<String> {
            recording_warnings("a.flac", info, samples).iter().map(|(_, text)| text.to_string()).collect()
        };
        assert!(texts(&info, &[0.5, -0.5, 0.5, -0.4]).is_empty());
        assert!(texts(&info, &[]).is_empty() && texts(&info, &[0.0; 4]).is_empty());
        let found = texts(&info, &[0.3, 0.3, 0.3, 0.3]);
        assert!(found.len() == 1 && found[0].contains("100 %") && found[0].contains("0.300"), "{found:?}");
        let lost = AudioInfo { warnings: vec![AudioWarning::CorruptPackets { packets: 2 }], ..info };
        let found = texts(&lost, &[0.5, -0.5]);
        assert!(found.len() == 1 && found[0].contains("2 packets"), "{found:?}");
        assert_eq!(lost.warning_texts("a.flac").count(), 1);
    }
}
