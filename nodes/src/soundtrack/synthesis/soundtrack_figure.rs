//! The figure of a soundtrack: recordings, score and output.

use super::position::SourcePosition;
use super::waveform::Waveform;
use crate::plot::{Chart, Line};
use crate::soundtrack::score::{ScoreSource, SoundScore};
use crate::soundtrack::wavelet::WaveletTree;

/// Points of a line.
const POINTS: usize = 3000;
/// Sounds and recordings that are drawn.
const MAX_DRAWN: usize = 8;
/// The axis of most charts.
const TIME: (&str, bool) = ("time of the output, s", false);

/// True if a time of a recording is within a sound, which comes with its recording.
pub fn is_within((recording, sound): &(usize, &ScoreSource), of: usize, t: f64) -> bool {
    *recording == of && sound.segments.iter().any(|(from, to)| t >= from - 1e-4 && t < *to)
}

/// The sounds of a score with their recordings.
pub fn located<'a>(score: &'a SoundScore, tree: &WaveletTree) -> Vec<(usize, &'a ScoreSource)> {
    let recording = |s: &ScoreSource| tree.find(s.recording.as_deref().unwrap_or_default());
    score.sources.iter().map(|s| (recording(s).unwrap_or(usize::MAX), s)).collect()
}

/// Data of a figure.
pub struct SoundtrackFigure<'a> {
    positions: &'a [SourcePosition],
    /// Positions per second.
    rate: f64,
    score: Option<&'a SoundScore>,
    tree: &'a WaveletTree,
    /// The sounds that are drawn, with their recordings, and their names.
    sounds: Vec<(usize, &'a ScoreSource)>,
    names: Vec<String>,
}

/// The end of a path.
fn short(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

impl<'a> SoundtrackFigure<'a> {
    /// Creates the figure of the positions of an output.
    pub fn new(
        positions: &'a [SourcePosition],
        rate: f64,
        score: Option<&'a SoundScore>,
        tree: &'a WaveletTree,
    ) -> Self {
        let mut sounds = score.map_or_else(Vec::new, |score| located(score, tree));
        sounds.truncate(MAX_DRAWN);
        let names = sounds.iter().map(|(_, sound)| sound.name.clone()).collect();
        Self { positions, rate, score, tree, sounds, names }
    }

    /// All charts. `runs` are the lengths of the stretches that are copied, in increasing order.
    pub fn charts(&self, output: &Waveform, runs: &[usize]) -> Vec<Chart> {
        let mut charts = Vec::new();
        if let Some(score) = self.score {
            charts.extend((0..self.tree.sources.len().min(MAX_DRAWN)).map(|k| self.recording(k)));
            charts.push(self.curves(score));
        }
        if !output.is_empty() {
            let lines = output.lines(2.0 * self.rate, &self.names, |t| self.sound_at(t));
            charts.push(Chart::of("output", TIME, ("amplitude", false), lines));
        }
        charts.extend([self.origins(), self.stretches(runs)]);
        charts
    }

    /// The waveform of a recording, with the intervals of each sound.
    fn recording(&self, k: usize) -> Chart {
        let source = &self.tree.sources[k];
        let mut audio = self.tree.audio(k, 0);
        audio.truncate(source.frames as usize);
        let mut wave = Waveform::new(audio.len());
        wave.add(audio.into_iter());
        let owner = |t: f64| self.sounds.iter().position(|sound| is_within(sound, k, t));
        let lines = wave.lines(self.tree.rate, &self.names, owner);
        Chart::of(short(&source.name), ("time in the recording, s", false), ("amplitude", false), lines)
    }

    /// The weights of each sound.
    fn curves(&self, score: &SoundScore) -> Chart {
        let curve = |(k, name): (usize, &String)| {
            let mut points = Vec::new();
            for target in score.targets.iter().filter(|t| t.sources.contains(&k)) {
                let curve = &target.curve.points;
                points.extend(curve.first().map(|p| [p.0, 0.0]));
                points.extend(curve.iter().map(|p| [p.0, p.1]));
                points.extend(curve.last().map(|p| [p.0, 0.0]));
            }
            Line::new(name.clone(), points)
        };
        let mut lines: Vec<Line> = self.names.iter().enumerate().map(curve).collect();
        // As many lines as the waveforms have, for the same colours.
        lines.push(Line::new("other", Vec::new()));
        Chart::of("score", TIME, ("weight", false), lines)
    }

    /// The sound that the output comes from at a time; of several, the one that is wanted then.
    fn sound_at(&self, t: f64) -> Option<usize> {
        let position = self.positions.get((t * self.rate) as usize)?;
        let (recording, time) = (position.recording as usize, f64::from(position.seconds));
        let own = || (0..self.sounds.len()).filter(|k| is_within(&self.sounds[*k], recording, time));
        let is_wanted = |k: &usize| {
            let targets = self.score.into_iter().flat_map(|score| &score.targets);
            let mut ends = targets.filter(|t| t.sources.contains(k)).filter_map(|t| t.curve.ends());
            ends.any(|(from, to)| from <= t && t < to)
        };
        own().find(is_wanted).or_else(|| own().next())
    }

    /// The time in the recordings against that of the output.
    fn origins(&self) -> Chart {
        let stride = self.positions.len().div_ceil(POINTS).max(1);
        let line = |k: usize| {
            let all = self.positions.iter().enumerate().step_by(stride);
            let own = all.filter(|(_, p)| p.recording as usize == k);
            let points = own.map(|(n, p)| [n as f64 / self.rate, f64::from(p.seconds)]).collect();
            Line::dots(short(&self.tree.sources[k].name), points)
        };
        let lines = (0..self.tree.sources.len().min(MAX_DRAWN)).map(line).collect();
        Chart::of("where the sound comes from", TIME, ("time in the recording, s", false), lines)
    }

    /// The share of the time in stretches that are no longer than each.
    fn stretches(&self, runs: &[usize]) -> Chart {
        let total: usize = runs.iter().sum();
        let mut points: Vec<[f64; 2]> = Vec::new();
        let mut sum = 0;
        for same in runs.chunk_by(|a, b| a == b) {
            sum += same.iter().sum::<usize>();
            points.push([same[0] as f64 / self.rate, sum as f64 / total.max(1) as f64]);
        }
        let lines = vec![Line::new("share", points)];
        Chart::of("stretches that are copied", ("length, s", true), ("share of the time", false), lines)
    }
}
