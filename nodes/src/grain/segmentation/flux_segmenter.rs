//! The node `FluxSegmenter`.

use super::cut_stream::CutStream;
use super::segments::{CutKind, SegmentRules, check_lengths};
use super::spectral_flux::mono;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick};
use crate::dsp::Trigger;
use crate::feature::FluxFrames;
use crate::{archive_state, params, ports};
use std::collections::VecDeque;

params! {
    /// Finds the cuts of a sound at inflection points of its spectral flux, and its onsets, while it plays.
    ///
    /// The flux is smoothed by a Gaussian. The sound is cut where the flux begins or ceases to change. Segments shorter than `shortest` are
    /// joined by removing the cut at the smaller slope of the flux of the shortest one, repeatedly. Segments longer than `longest` are cut where
    /// the flux is steepest. The start and the end are cuts too.
    ///
    /// The output lags the flux by 2.6 times `longest` less `shortest`, and by six hops and four times `smoothing`: 0.21 s with the
    /// defaults. Within this look-ahead the cuts are those that `GrainDictionary` finds in the recording as a whole. They differ where segments
    /// shorter than `shortest` follow each other for more than half of `longest`, where no inflection follows within twice `longest`, as in
    /// silence, which is then cut after each `longest`, and in the middle of a flat flux. The report counts the first two cases.
    ///
    /// Onsets are rising inflections. Those of `GrainDictionary` follow from the loudest band of the recording as a whole and are more reliable.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.2; the
    /// paper gives the range of lengths, the rules are of this project.
    pub struct FluxSegmenterParams {
        /// Samples of the sound from one item of the flux to the next: the `hop` of `SpectralFlux`.
        hop: usize = 128, unit "samples", range 1..=65_536_usize;
        /// Width of the smoothing.
        smoothing: f64 = 2.0, unit "frames", range 0.0..=100.0;
        /// Shortest segment.
        shortest: f64 = 0.0068027, unit "s", range 0.001..=1.0;
        /// Longest segment, at least twice the shortest.
        longest: f64 = 0.0680272, unit "s", range 0.002..=10.0;
        /// Inflection points that become cuts.
        kind: CutKind = CutKind::Both;
        /// Lowest slope of the smoothed flux at an onset.
        onset_slope: f64 = 0.03, unit "1/frame", range 0.0..=1.0;
    }
}
ports! {
    /// Ports of `FluxSegmenter`.
    pub struct FluxSegmenterPorts / FluxSegmenterIo {
        in {
            /// The flux, one item per hop.
            flux: Stream<f32>,
        }
        out {
            /// A trigger at each cut.
            cuts: Events<Trigger>,
            /// A trigger at each onset.
            onsets: Events<Trigger>,
        }
    }
}

/// The node over [`CutStream`].
pub struct FluxSegmenter {
    stream: CutStream,
    /// Rate of the sound.
    rate: Rate,
    hop: i64,
    /// Items and samples of the whole, if it has an end.
    items: Option<i64>,
    len: Option<i64>,
    /// The last tick.
    last: Tick,
    /// The first item, and the number of items since.
    first: Option<i64>,
    received: i64,
    cuts: VecDeque<usize>,
    onsets: VecDeque<usize>,
}

impl FluxSegmenterParams {
    fn rules(&self, flux: Rate) -> Result<(SegmentRules, Rate), Reject> {
        let too_fast = || Reject::new("F051", format!("{} items of {flux} are too fast", self.hop)).at("hop");
        let rate = flux.times(self.hop as u64).ok_or_else(too_fast)?;
        let samples = |seconds: f64| (seconds * rate.as_f64()).round() as usize;
        let rules = SegmentRules {
            frames: FluxFrames { hop: self.hop, ..FluxFrames::at_rate(rate.as_f64()) },
            sigma: self.smoothing,
            min: samples(self.shortest).max(2),
            max: samples(self.longest).max(4),
            kind: self.kind,
            ..SegmentRules::at_rate(rate.as_f64())
        };
        check_lengths(self.shortest, self.longest)?;
        Ok((rules, rate))
    }
}

impl Node for FluxSegmenter {
    type Params = FluxSegmenterParams;
    type Ports = FluxSegmenterPorts;
    const NAME: &'static str = "FluxSegmenter";
    const CLASS: Class = Class::Worker;
    const VERSION: u32 = 2;
    const COST: f64 = 100.0;

    fn shape(p: &FluxSegmenterParams, s: &mut Shape<'_, '_, FluxSegmenterPorts>) -> Result<(), Reject> {
        let flux = s.input(FluxSegmenterPorts::flux);
        s.check(mono(flux.format, "flux"));
        let (rules, rate) = p.rules(flux.rate)?;
        s.lag(rate.span(CutStream::latency(&rules)));
        Ok(())
    }

    fn build(p: &FluxSegmenterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let flux = cx.input(FluxSegmenterPorts::flux);
        let (rules, rate) = p.rules(flux.rate)?;
        Ok(Self {
            stream: CutStream::new(rules, p.onset_slope),
            rate,
            hop: rules.frames.hop as i64,
            items: flux.items(),
            // The last frame may be centred on the end.
            len: flux.end.map(|end| rate.first_at(end - 1)),
            last: flux.end.map_or(Tick::MAX, |end| end - 1),
            first: None,
            received: 0,
            cuts: VecDeque::new(),
            onsets: VecDeque::new(),
        })
    }

    fn run(&mut self, mut io: FluxSegmenterIo<'_>) -> Result<(), Fault> {
        if io.flux.is_empty() && self.first.is_none() {
            return Ok(());
        }
        let first = *self.first.get_or_insert(io.flux.first());
        // While the last cuts are written, there are items after the end.
        let left = self.items.map_or(usize::MAX, |items| (items - first - self.received).max(0) as usize);
        for flux in io.flux.items().iter().take(left) {
            self.stream.next(*flux);
            self.received += 1;
            if self.items == Some(first + self.received) {
                let len = self.len.unwrap_or_default() - first * self.hop;
                self.stream.finish(usize::try_from(len).unwrap_or_default().max(1));
            }
        }
        self.stream.take(&mut self.cuts, &mut self.onsets);
        let tick = |sample: &usize| self.rate.tick(first * self.hop + *sample as i64).min(self.last);
        let (_, to) = io.cuts.window();
        while let Some(at) = self.cuts.front().map(tick).filter(|at| *at < to) {
            // Where the node begins is no cut, unless it is the start of the sound.
            if self.cuts.pop_front() != Some(0) || first == 0 {
                io.cuts.push(at, Trigger::of(1.0));
            }
        }
        while let Some(at) = self.onsets.front().map(tick).filter(|at| *at < to) {
            self.onsets.pop_front();
            io.onsets.push(at, Trigger::of(1.0));
        }
        Ok(())
    }

    fn finish(&mut self, _: FluxSegmenterIo<'_>) -> Result<Summary, Fault> {
        let CutStream { early_joins, early_splits, .. } = self.stream;
        Ok(vec![("early_joins", early_joins.into()), ("early_splits", early_splits.into())])
    }

    archive_state!(stream, first, received, cuts, onsets);

    fn trial(rng: &mut Rng) -> (FluxSegmenterParams, MemoryFiles) {
        let p = FluxSegmenterParams::trial(rng);
        let shortest = rng.between(0.001, 0.05);
        let params = FluxSegmenterParams {
            hop: 1 + p.hop % 16,
            smoothing: p.smoothing % 3.0,
            shortest,
            longest: shortest * rng.between(2.1, 8.0),
            ..p
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
