//! The node `GrainDictionary`.

use super::extraction::{ExtractRules, TaperPlacement, extract, extraction_table, times_table};
use super::grains::GrainDictionary;
use super::taper::TaperShape;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::feature::FluxFrames;
use crate::grain::recording::GrainRecordings;
use crate::grain::segmentation::segments::check_lengths;
use crate::grain::segmentation::{CutKind, SegmentRules};
use crate::table::ResultTable;
use crate::{params, ports};

params! {
    /// Cuts recordings into grains, from which sounds are synthesised.
    ///
    /// Cuts are the inflection points of the smoothed spectral flux, where the spectrum begins or ceases to change. Grains are some 25 ms
    /// long. Neighbours overlap in short tapers around their cut and join seamlessly. Steady and transient parts of continuous
    /// recordings have their own grains. Grains below the levels of `discard` are left out.
    ///
    /// A tap of `dictionary` as BIN writes a file for `GrainDictionaryFile`. `table` has a row for each recording; as SVG it draws the flux
    /// and the cuts of the first ones.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), sections 3.2 and
    /// 3.3. The paper leaves the frames of the flux, the smoothing and the level of discarded grains open.
    pub struct GrainDictionaryParams {
        /// Shortest grain.
        shortest: f64 = 0.0068027, unit "s", range 0.001..=1.0;
        /// Longest grain.
        longest: f64 = 0.0680272, unit "s", range 0.002..=10.0;
        /// Width of the smoothing of the flux.
        smoothing: f64 = 2.0, unit "frames", range 0.0..=100.0;
        /// Duration of a frame of the flux, rounded to a power of two of samples; frames follow each other by a quarter.
        frame: f64 = 0.0116, unit "s", range 0.0005..=0.5;
        /// Exponent of the magnitudes in the flux: 1, or 2 for the power spectrum of the paper.
        exponent: u32 = 1, unit "", range 1..=2_u32;
        /// Inflection points that become cuts.
        cuts: CutKind = CutKind::Both;
        /// Rise of the onset strength over its mean that makes an onset.
        onset_rise: f64 = 0.4, unit "", range 0.0..=10.0;
        /// Time within which a cut moves to the nearest zero crossing; 0 leaves it.
        snap_zero: f64 = 0.0, unit "s", range 0.0..=0.01;
        /// Share of both tapers in a grain.
        taper: f64 = 0.02, unit "", range 0.0..=0.5;
        /// Shape of the tapers.
        taper_shape: TaperShape = TaperShape::HalfSample;
        /// Position of the tapers.
        placement: TaperPlacement = TaperPlacement::Outside;
        /// Levels below which a grain is discarded: relative to the loudest grain of its recording, and of full scale.
        discard: [f64; 2] = [-50.0, -70.0], unit "dB", range -300.0..=0.0;
        /// Sound stored beyond the ends of grains without neighbours, for joins.
        margin: f64 = 0.005, unit "s", range 0.0..=0.1;
        /// Bits of the samples, each grain scaled to its own peak; None for 32-bit floats. Files are coded as FLAC, so that fewer bits take
        /// fewer bytes.
        bits: Option<u32> = Some(16), unit "bits", range 4..=16_u32;
        /// Stores the sinusoids of steady grains, with which `GrainRetarget` changes their frequency and not their duration. They take about as
        /// many bytes as the samples.
        tracks: bool = false;
    }
}
ports! {
    pub struct GrainDictionaryPorts / GrainDictionaryIo {
        in {
            /// The recordings.
            recordings: Value<GrainRecordings>,
        }
        out {
            /// The grains.
            dictionary: Value<GrainDictionary>,
            /// Numbers of grains, cuts and onsets of each recording.
            table: Value<ResultTable>,
            /// Time of each onset, and of each cut.
            times: Value<ResultTable>,
        }
    }
}

/// The node over [`extract`].
#[derive(Debug)]
pub struct GrainDictionaryNode;

impl GrainDictionaryParams {
    fn rules(&self, rate: f64) -> ExtractRules {
        let samples = |seconds: f64| (seconds * rate).round() as usize;
        let frame = 1_usize << (self.frame * rate).max(8.0).log2().round() as u32;
        let frames = FluxFrames { frame, hop: frame / 4, exponent: self.exponent };
        ExtractRules {
            segments: SegmentRules {
                rate,
                frames,
                sigma: self.smoothing,
                min: samples(self.shortest).max(2),
                max: samples(self.longest).max(4),
                kind: self.cuts,
                onset_rise: self.onset_rise,
            },
            taper_ratio: self.taper,
            shape: self.taper_shape,
            placement: self.placement,
            discard: self.discard,
            margin: samples(self.margin),
            bits: self.bits.map_or(0, |bits| bits as u16),
            snap: samples(self.snap_zero),
            tracks: self.tracks,
        }
    }
}

impl Func for GrainDictionaryNode {
    type Params = GrainDictionaryParams;
    type Ports = GrainDictionaryPorts;
    const NAME: &'static str = "GrainDictionary";
    const VERSION: u32 = 3;
    // Sources are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &GrainDictionaryParams, s: &mut Shape<'_, '_, GrainDictionaryPorts>) -> Result<(), Reject> {
        s.check(check_lengths(p.shortest, p.longest));
        // The flux must be finer than the shortest grain.
        if p.frame / 4.0 > p.shortest / 2.0 {
            let message = format!(
                "frames of the flux every {:.4} s are too coarse for grains of {} s",
                p.frame / 4.0,
                p.shortest
            );
            let help = format!("set `frame` to at most {:.4}", 2.0 * p.shortest);
            s.wrong(Reject::new("F150", message).at("frame").help(help));
        }
        Ok(())
    }

    fn eval(
        p: &GrainDictionaryParams,
        _: &Build<'_>,
        mut io: GrainDictionaryIo<'_>,
    ) -> Result<Summary, Fault> {
        let recordings = io.recordings;
        let rules = p.rules(recordings.rate);
        let (dictionary, extracted) = extract(recordings, &rules);
        dictionary.validate().map_err(|e| Fault::new("F150", e.to_string()).at("recordings"))?;
        let mut summary = dictionary.summary();
        let samples: usize = recordings
            .recordings
            .iter()
            .map(|r| r.len() * r.parts.first().map_or(1, |p| p.channels.len()))
            .sum();
        summary
            .push(("share_of_recordings", (dictionary.bytes() as f64 / (2 * samples).max(1) as f64).into()));
        summary.push(("discarded", extracted.iter().map(|e| e.discarded[0]).sum::<usize>().into()));
        io.times.set(times_table(recordings, &extracted));
        io.table.set(extraction_table(recordings, &extracted, &rules));
        io.dictionary.set(dictionary);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (GrainDictionaryParams, MemoryFiles) {
        let p = GrainDictionaryParams::trial(rng);
        let shortest = rng.between(0.005, 0.01);
        let params = GrainDictionaryParams {
            shortest,
            longest: shortest * rng.between(2.0, 10.0),
            frame: shortest,
            smoothing: rng.between(0.5, 4.0),
            discard: [rng.between(-80.0, -50.0), rng.between(-120.0, -80.0)],
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_rules() {
        let p = GrainDictionaryParams::read(&|_| None).unwrap();
        assert_eq!(p.rules(44_100.0), ExtractRules::at_rate(44_100.0));
        assert_eq!(p.rules(48_000.0).segments.frames, FluxFrames::at_rate(48_000.0));
        assert_eq!((p.rules(44_100.0).segments.min, p.rules(44_100.0).segments.max), (300, 3000));
    }
}
