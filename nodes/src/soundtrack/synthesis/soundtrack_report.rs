//! The node `SoundtrackReport`.

use super::position::{SourcePosition, SourcePositions};
use super::soundtrack_figure::{SoundtrackFigure, is_within, located};
use super::waveform::Waveform;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Shape};
use crate::soundtrack::score::{ScoreSource, SoundScore};
use crate::soundtrack::wavelet::{TextureModel, WaveletTree};
use crate::table::ResultTable;
use crate::{archive_state, params, ports};

params! {
    /// Reports where the sounds of a texture come from: lengths of the stretches that are copied, and how well a score is satisfied.
    ///
    /// `table` has a row for each target of the score: the sounds, the interval, the mean weight, and the share of its time that is of the sounds.
    /// Tapped as SVG it draws the waveforms of the recordings with the intervals of each sound, the curves of the score, the waveform of the output in
    /// the colours of the sounds that it comes from, the time in the recordings against that of the output, and the stretches by length.
    ///
    /// # Source
    /// Figures 3 and 4 of Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003): intervals, weighting curves and the result.
    pub struct SoundtrackReportParams {}
}
ports! {
    pub struct SoundtrackReportPorts / SoundtrackReportIo {
        in {
            /// Positions in recordings that the samples come from.
            positions: Stream<SourcePositions>,
            /// The model.
            model: Value<TextureModel>,
            /// The score.
            score: Option<Value<SoundScore>>,
            /// The output, to be drawn.
            audio: Option<Stream<f32>>,
        }
        out {
            /// Targets and their satisfaction.
            table: Fold<ResultTable>,
        }
    }
}

/// Longest output, in pairs of samples: an hour at 96 kHz.
const MAX_POSITIONS: i64 = 172_800_000;

/// The node `SoundtrackReport`.
#[derive(Debug)]
pub struct SoundtrackReport {
    positions: Vec<SourcePosition>,
    rate: f64,
    limit: usize,
    wave: Waveform,
}

/// Lengths of the stretches of recordings that are copied, in positions.
fn runs(positions: &[SourcePosition]) -> Vec<usize> {
    let mut all = Vec::new();
    let mut run = 0;
    for (k, position) in positions.iter().enumerate() {
        let goes_on = k.checked_sub(1).is_some_and(|before| {
            let before = positions[before];
            before.recording == position.recording && before.frame + 2 == position.frame
        });
        if !goes_on && run > 0 {
            all.push(run);
            run = 0;
        }
        run += 1;
    }
    all.extend((run > 0).then_some(run));
    all
}

/// Share of positions that are within sounds; `None` without positions.
fn share(positions: &[SourcePosition], sounds: &[(usize, &ScoreSource)]) -> Option<f64> {
    let is_in = |p: &&SourcePosition| {
        sounds.iter().any(|sound| is_within(sound, p.recording as usize, f64::from(p.seconds)))
    };
    let count = positions.iter().filter(is_in).count();
    (!positions.is_empty()).then(|| count as f64 / positions.len() as f64)
}

impl SoundtrackReport {
    fn fill(&self, table: &mut ResultTable, score: &SoundScore, tree: &WaveletTree) -> f64 {
        let (mut weighted, mut total) = (0.0, 0.0);
        let all = located(score, tree);
        for target in &score.targets {
            let points = &target.curve.points;
            let Some((first, last)) = target.curve.ends() else { continue };
            let at = |t: f64| ((t * self.rate).round().max(0.0) as usize).min(self.positions.len());
            let own = &self.positions[at(first)..at(last).max(at(first))];
            let sounds: Vec<(usize, &ScoreSource)> =
                target.sources.iter().filter_map(|k| all.get(*k).copied()).collect();
            let share = share(own, &sounds);
            let area: f64 = points.windows(2).map(|p| 0.5 * (p[0].1 + p[1].1) * (p[1].0 - p[0].0)).sum();
            let weight = area / (last - first).max(1e-12);
            table.push([
                score.names(&target.sources).into(),
                first.into(),
                last.into(),
                weight.into(),
                share.into(),
            ]);
            if let Some(share) = share.filter(|_| weight > 0.0) {
                weighted += share * (last - first);
                total += last - first;
            }
        }
        if total > 0.0 { weighted / total } else { 0.0 }
    }
}

impl Node for SoundtrackReport {
    type Params = SoundtrackReportParams;
    type Ports = SoundtrackReportPorts;
    const NAME: &'static str = "SoundtrackReport";
    const CLASS: Class = Class::Offline;

    fn shape(_: &SoundtrackReportParams, s: &mut Shape<'_, '_, SoundtrackReportPorts>) -> Result<(), Reject> {
        let positions = s.input(SoundtrackReportPorts::positions);
        if positions.items().is_none_or(|n| n > MAX_POSITIONS) {
            let reject = Reject::new("F156", "the output is endless, or longer than a report is made of");
            return Err(reject.at("positions").help("give the TextureSynthesis a `duration`"));
        }
        if let Some(audio) = s.optional(SoundtrackReportPorts::audio) {
            let of_positions = audio.rate.divided_by(2);
            if of_positions != Some(positions.rate) {
                let message = format!(
                    "the audio has {}, and its positions have {}, which is not half of it",
                    audio.rate, positions.rate
                );
                return Err(Reject::new("F156", message)
                    .at("audio")
                    .help("link `audio` and `positions` of one TextureSynthesis"));
            }
        }
        s.ends(positions.end);
        Ok(())
    }

    fn build(_: &SoundtrackReportParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let positions = cx.input(SoundtrackReportPorts::positions);
        let limit = positions.items().unwrap_or(0).clamp(0, MAX_POSITIONS) as usize;
        let wave = Waveform::new(2 * limit);
        Ok(Self { positions: Vec::with_capacity(limit), rate: positions.rate.as_f64(), limit, wave })
    }

    fn run(&mut self, io: SoundtrackReportIo<'_>) -> Result<(), Fault> {
        let items = io.positions.items();
        let left = self.limit - self.positions.len();
        self.positions.extend_from_slice(&items[..items.len().min(left)]);
        if let Some(audio) = &io.audio {
            let width = audio.width();
            let frames = audio.items().chunks_exact(width);
            self.wave.add(frames.map(|frame| frame.iter().sum::<f32>() / width as f32));
        }
        Ok(())
    }

    fn finish(&mut self, mut io: SoundtrackReportIo<'_>) -> Result<Summary, Fault> {
        let mut table = ResultTable::new(&["sounds", "from_s", "to_s", "weight", "share"]);
        let mut runs = runs(&self.positions);
        let mut summary = Summary::new();
        if let Some(score) = io.score {
            let share = self.fill(&mut table, score, &io.model.tree);
            summary.push(("satisfaction", share.into()));
        }
        runs.sort_unstable();
        let figure = SoundtrackFigure::new(&self.positions, self.rate, io.score, &io.model.tree);
        table.charts = figure.charts(&self.wave, &runs);
        let seconds = |run: Option<&usize>| run.map_or(0.0, |run| *run as f64 / self.rate);
        let copied = 1.0 - runs.len() as f64 / self.positions.len().max(1) as f64;
        summary.extend([
            ("longest_run_s", seconds(runs.last()).into()),
            ("median_run_s", seconds(runs.get(runs.len() / 2)).into()),
            ("copied_share", copied.into()),
        ]);
        self.positions.clear();
        io.table.set(table);
        Ok(summary)
    }

    archive_state!(positions, wave);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::feed::Feed;
    use crate::core::item::{AnyValue, Data};
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::soundtrack::score::read_score;

    #[test]
    fn shares_and_stretches_are_counted() {
        let position = |recording, frame| SourcePosition { recording, frame, seconds: frame as f32 / 8000.0 };
        let mut positions: Vec<SourcePosition> = (0..2000).map(|k| position(0, 2 * k)).collect();
        positions.extend((0..1000).map(|k| position(1, 2 * k)));
        positions.extend((0..1000).map(|k| position(1, 2 * k)));
        assert_eq!(runs(&positions), [2000, 1000, 1000]);
        let score = read_score(
            "SoundScore(sources: [(name: \"a\", segments: [(0.25, 0.5)]), (name: \"b\", segments: [(0, 0.125)], recording: \"b.wav\")],
             targets: [(source: \"a\", from: 0, to: 0.5), (source: \"b\", from: 0.5, to: 1, weight: 0.5), (source: \"a\", from: 2, to: 3)])",
        );
        let run = Standalone::new::<SoundtrackReport>(SoundtrackReportParams {})
            .input(SoundtrackReportPorts::positions, Rate::hz(4000), (), positions)
            .value(SoundtrackReportPorts::model, TextureModel::trial(&mut Rng::new(1)))
            .feed(SoundtrackReportPorts::score.index(), Feed::value(AnyValue::new(score.unwrap())))
            .run()
            .unwrap();
        let value = run.value(0).unwrap();
        let table: &ResultTable = value.get().unwrap();
        assert_eq!(
            table.csv(),
            "sounds,from_s,to_s,weight,share\na,0,0.500000,1,0.500000\nb,0.500000,1,0.500000,0.500000\na,2,3,1,\n"
        );
        assert!(table.plot().unwrap().contains("stretches"));
        let figure = |name| run.summary.iter().find(|(n, _)| *n == name).unwrap().1.as_f64().unwrap();
        assert_eq!(
            (figure("longest_run_s"), figure("median_run_s"), figure("satisfaction")),
            (0.5, 0.25, 0.5)
        );
    }
}
