//! Figures of audio.

use super::text::{Listing, db, figure, percent};
use super::{ProbeOptions, within};
use crate::run::{Columns, Envelope, SILENCE_DB, StreamChart};
use foley_nodes::core::item::StreamShape;
use foley_nodes::core::time::{Rate, Tick, seconds};
use foley_nodes::dsp::{SoundMeter, linear_to_db};
use serde::Serialize;

/// Figures of a stream of audio.
#[derive(Clone, Debug, Serialize)]
pub struct SoundReport {
    /// Samples per second and channel.
    pub rate: f64,
    /// Number of channels.
    pub channels: usize,
    /// Start of the measurement, s.
    pub from: f64,
    /// Its length, s.
    pub seconds: f64,
    /// Its length in samples of a channel.
    pub frames: u64,
    /// Largest magnitude.
    pub peak: f64,
    /// Largest magnitude, dB of full scale.
    pub peak_db: f64,
    /// Time of the first sample with it, s.
    pub peak_at: f64,
    /// Root mean square, dB of full scale.
    pub rms_db: f64,
    /// Integrated loudness, LUFS, as of `foley levels`.
    pub lufs: f64,
    /// A-weighted root mean square, dB of full scale.
    pub dba: f64,
    /// Centroid of the power spectrum, Hz.
    pub centroid_hz: f64,
    /// Mean of all samples.
    pub dc_offset: f64,
    /// Samples that are not finite; they count as 0 elsewhere.
    pub not_finite: u64,
    /// Samples beyond full scale.
    pub clipped: u64,
    /// Time of the first sample that is not 0, s.
    pub first_sound: Option<f64>,
    /// Time of the last one, s.
    pub last_sound: Option<f64>,
    /// Share of the windows whose peak is above -80 dB of the peak of all.
    pub active_share: f64,
    /// Length of such a window, s.
    pub active_window: f64,
    /// Per channel, where there are several that differ.
    pub per_channel: Vec<ChannelFigures>,
}

/// Figures of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelFigures {
    /// Largest magnitude, dB of full scale.
    pub peak_db: f64,
    /// Root mean square, dB of full scale.
    pub rms_db: f64,
    /// Mean.
    pub dc_offset: f64,
    /// Time of the first sample that is not 0, s.
    pub first_sound: Option<f64>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Channel {
    /// Largest magnitude, and its sample.
    peak: (f64, i64),
    sum: f64,
    sum_squares: f64,
    not_finite: u64,
    clipped: u64,
    /// First and last sample that is not 0.
    sound: Option<[i64; 2]>,
}

impl Channel {
    fn push(&mut self, at: i64, x: f32) {
        if !x.is_finite() {
            self.not_finite += 1;
            return;
        }
        let x = f64::from(x);
        if x.abs() > self.peak.0 {
            self.peak = (x.abs(), at);
        }
        self.sum += x;
        self.sum_squares += x * x;
        self.clipped += u64::from(x.abs() > 1.0);
        if x != 0.0 {
            self.sound = Some([self.sound.map_or(at, |[first, _]| first), at]);
        }
    }
}

/// Measures audio.
#[derive(Debug)]
pub(super) struct SoundProbe {
    rate: Rate,
    /// Samples that are measured, and the end of the stream if it has one.
    range: [i64; 2],
    frames: u64,
    meter: SoundMeter,
    channels: Vec<Channel>,
    envelope: Envelope,
    chart: StreamChart,
    finite: Vec<f32>,
}

impl SoundProbe {
    pub(super) fn new(shape: &StreamShape, options: &ProbeOptions) -> Self {
        let (rate, width) = (shape.rate, shape.width);
        let to = shape.end.map_or(options.to, |end| end.min(options.to));
        Self {
            rate,
            range: [rate.first_at(options.from), rate.first_at(to)],
            frames: 0,
            meter: SoundMeter::new(rate.as_f64(), width),
            channels: vec![Channel::default(); width],
            envelope: Envelope::of_rate(rate),
            chart: StreamChart::new(options.output.clone(), rate, Columns::each(shape.item, width)),
            finite: Vec::new(),
        }
    }

    pub(super) fn push(&mut self, first: i64, samples: &[f32]) {
        let width = self.channels.len();
        let [from, to] = self.range;
        let (first, samples) = within(first, samples, width, from, to);
        for (at, frame) in (first..).zip(samples.chunks_exact(width.max(1))) {
            self.channels.iter_mut().zip(frame).for_each(|(channel, x)| channel.push(at, *x));
            self.frames += 1;
        }
        self.finite.clear();
        self.finite.extend(samples.iter().map(|x| if x.is_finite() { *x } else { 0.0 }));
        self.meter.process(&self.finite);
        // Times of the envelope begin with the time that is measured.
        self.envelope.push(self.rate, width, first - from, &self.finite);
        self.chart.push(first, samples);
    }

    fn time(&self, sample: i64) -> f64 {
        seconds(self.rate.tick(sample))
    }

    pub(super) fn report(&self) -> SoundReport {
        let figures = self.meter.figures();
        let sum = |of: fn(&Channel) -> f64| self.channels.iter().map(of).sum::<f64>();
        let count = |of: fn(&Channel) -> u64| self.channels.iter().map(of).sum::<u64>();
        let samples = (self.frames.max(1) * self.channels.len().max(1) as u64) as f64;
        let (peak, peak_at) = self.channels.iter().fold((0.0, self.range[0]), |best, channel| {
            let earlier = channel.peak.0 == best.0 && channel.peak.1 < best.1;
            if channel.peak.0 > best.0 || earlier { channel.peak } else { best }
        });
        let sounds = || self.channels.iter().filter_map(|channel| channel.sound);
        let length: Tick = self.rate.tick(self.frames as i64);
        let differ = self.channels.windows(2).any(|pair| pair[0] != pair[1]);
        let one = |channel: &Channel| ChannelFigures {
            peak_db: linear_to_db(channel.peak.0),
            rms_db: linear_to_db((channel.sum_squares / self.frames.max(1) as f64).sqrt()),
            dc_offset: channel.sum / self.frames.max(1) as f64,
            first_sound: channel.sound.map(|[first, _]| self.time(first)),
        };
        SoundReport {
            rate: self.rate.as_f64(),
            channels: self.channels.len(),
            from: self.time(self.range[0]),
            seconds: seconds(length),
            frames: self.frames,
            peak,
            peak_db: linear_to_db(peak),
            peak_at: self.time(peak_at),
            rms_db: linear_to_db((sum(|c| c.sum_squares) / samples).sqrt()),
            lufs: figures.lufs,
            dba: figures.dba,
            centroid_hz: figures.centroid_hz,
            dc_offset: sum(|c| c.sum) / samples,
            not_finite: count(|c| c.not_finite),
            clipped: count(|c| c.clipped),
            first_sound: sounds().map(|[first, _]| first).min().map(|first| self.time(first)),
            last_sound: sounds().map(|[_, last]| last).max().map(|last| self.time(last)),
            active_share: self.envelope.active_share(length),
            active_window: seconds(self.envelope.interval()),
            per_channel: if differ { self.channels.iter().map(one).collect() } else { Vec::new() },
        }
    }

    pub(super) fn draw(&self) -> String {
        self.chart.draw()
    }
}

impl SoundReport {
    /// Lines for people.
    #[must_use]
    pub fn text(&self, output: &str) -> String {
        let channels = match self.channels {
            1 => "mono".to_owned(),
            2 => "stereo".to_owned(),
            n => format!("{n} channels"),
        };
        let mut out = Listing::new(&format!("{output}: audio, {} Hz, {channels}", figure(self.rate)));
        let from = if self.from > 0.0 { format!(" from {:.3} s on", self.from) } else { String::new() };
        out.line("length", format!("{:.3} s, {} frames{from}", self.seconds, self.frames));
        if self.peak > 0.0 {
            let peak = figure(self.peak);
            out.line("peak", format!("{} ({peak}) at {:.3} s", db(self.peak_db), self.peak_at));
            out.line("rms", format!("{}, A-weighted {}", db(self.rms_db), db(self.dba)));
            out.line("loudness", format!("{:.1} LUFS", self.lufs));
            out.line("centroid", format!("{:.0} Hz", self.centroid_hz));
            out.line("dc offset", figure(self.dc_offset));
        }
        out.line("not finite", format!("{} samples", self.not_finite));
        if self.clipped > 0 {
            out.line("clipped", format!("{} samples beyond full scale", self.clipped));
        }
        match (self.first_sound, self.last_sound) {
            (Some(first), Some(last)) => out.line(
                "sound",
                format!(
                    "from {first:.3} to {last:.3} s; {} of windows of {:.0} ms are above {SILENCE_DB} dB of the peak",
                    percent(self.active_share),
                    1000.0 * self.active_window
                ),
            ),
            _ => out.line("sound", "silent throughout"),
        }
        if !self.per_channel.is_empty() {
            let row = |(k, c): (usize, &ChannelFigures)| {
                let first = c.first_sound.map_or_else(|| "-".to_owned(), |first| format!("{first:.3}"));
                vec![k.to_string(), db(c.peak_db), db(c.rms_db), figure(c.dc_offset), first]
            };
            let rows: Vec<_> = self.per_channel.iter().enumerate().map(row).collect();
            out.table(&["channel", "peak", "rms", "dc offset", "sound from, s"], &rows);
        }
        out.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::item::Channels;
    use foley_nodes::core::time::ticks;
    use std::f64::consts::TAU;

    fn probe(from: f64, to: f64, sound: impl Fn(usize) -> [f32; 2]) -> SoundReport {
        let rate = Rate::hz(8000);
        let shape = StreamShape::new::<f32>(rate, Channels(2), Some(ticks(2.0)));
        let options = ProbeOptions { output: "a.audio".into(), first: 5, from: ticks(from), to: ticks(to) };
        let mut probe = SoundProbe::new(&shape, &options);
        let samples: Vec<f32> = (0..16_000).flat_map(sound).collect();
        for (k, block) in samples.chunks(2 * 111).enumerate() {
            probe.push(111 * k as i64, block);
        }
        probe.report()
    }

    #[test]
    fn a_tone_with_an_offset_on_one_channel_has_its_figures() {
        let tone = |n: usize| 0.5 * (TAU * 100.0 * n as f64 / 8000.0).sin() as f32;
        let found = probe(0.0, 10.0, |n| [if n < 8000 { 0.0 } else { tone(n) }, 0.25]);
        assert_eq!((found.frames, found.seconds, found.channels), (16_000, 2.0, 2));
        assert!((found.peak_db - linear_to_db(0.5)).abs() < 1e-6, "{found:?}");
        assert!((found.peak_at - 1.0025).abs() < 1e-9, "{found:?}");
        assert!((found.dc_offset - 0.125).abs() < 1e-6, "{found:?}");
        // Half of the samples of the one channel, and all of the other, have a mean square of 0.125 and 0.0625.
        assert!((found.rms_db - linear_to_db(0.25)).abs() < 1e-3, "{found:?}");
        assert_eq!(found.first_sound, Some(0.0));
        let first = found.per_channel[0].first_sound.unwrap();
        assert!((first - 1.0).abs() < 1e-3, "{first}");
        assert!(found.text("a.audio").contains("channel"), "{}", found.text("a.audio"));
    }

    #[test]
    fn a_range_restricts_all_figures() {
        let found = probe(0.5, 1.0, |n| if n < 4000 { [1.5; 2] } else { [0.1; 2] });
        assert_eq!((found.frames, found.from, found.clipped), (4000, 0.5, 0));
        assert!((found.peak - 0.1).abs() < 1e-6 && found.per_channel.is_empty(), "{found:?}");
        assert_eq!((found.first_sound, found.active_share), (Some(0.5), 1.0));
    }

    #[test]
    fn samples_that_are_not_finite_are_counted_and_leave_the_rest_as_it_is() {
        let found = probe(0.0, 2.0, |n| if n == 7 { [f32::NAN, f32::INFINITY] } else { [0.5; 2] });
        assert_eq!(found.not_finite, 2);
        assert!((found.peak - 0.5).abs() < 1e-6 && found.lufs.is_finite(), "{found:?}");
        let silent = probe(0.0, 2.0, |_| [0.0; 2]);
        assert_eq!((silent.first_sound, silent.active_share), (None, 0.0));
        assert!(silent.text("a").contains("silent throughout"));
    }
}
