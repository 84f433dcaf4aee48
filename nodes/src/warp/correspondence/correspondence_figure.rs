//! The figure of correspondences in the waveforms of both sides, as a node.

use super::marked_waveforms::{Mark, MarkedWaveforms, Waveform, WaveformMeter};
use super::pairing::{Interval, Target, intervals};
use super::set::CorrespondenceSet;
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Incoming, Shape};
use crate::unit::UnitDatabase;
use crate::{archive_state, params, ports};

params! {
    /// Draws the waveforms of a target and of the recordings of a database, with the intervals that should sound alike.
    ///
    /// A tap of `figure` as SVG has the target above and the recordings below, one after the other; correspondences have numbers in the order of
    /// their file. As JSON it states the times of each interval on both sides. Copies of an augmented database are left out.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), figure 11, top.
    pub struct CorrespondenceFigureParams {}
}
ports! {
    pub struct CorrespondenceFigurePorts / CorrespondenceFigureIo {
        in {
            /// Sound of the target.
            audio: Stream<f32>,
            /// The database.
            database: Value<UnitDatabase>,
            /// The correspondences.
            pairs: Value<CorrespondenceSet>,
        }
        out {
            /// The figure, once the target has ended.
            figure: Fold<MarkedWaveforms>,
        }
    }
}

/// Longest target, s.
const MAX_SECONDS: f64 = 3600.0;

/// The node over [`MarkedWaveforms`].
pub struct CorrespondenceFigure {
    target: WaveformMeter,
    marks: Vec<Mark>,
}

/// The intervals of all correspondences.
fn found(
    audio: &Incoming<f32>,
    db: &UnitDatabase,
    pairs: &CorrespondenceSet,
) -> Result<Vec<Interval>, Reject> {
    let seconds = audio.items().map(|n| n as f64 / audio.rate.as_f64()).filter(|s| *s <= MAX_SECONDS);
    let Some(seconds) = seconds else {
        let message = format!("`audio` does not end within {MAX_SECONDS:.0} s");
        return Err(Reject::new("F075", message).at("audio").help("cut it with Trim"));
    };
    let rate = db.conventions.rate.as_f64() / db.unit().max(1) as f64;
    // As Mfcc has for a sound of this length.
    let units = (seconds * rate).ceil() as usize;
    let target = Target { units, vectors: usize::from(audio.format.0.max(1)), rate };
    intervals(pairs, target, db).map_err(|e| Reject::new("F110", e.to_string()).at("pairs"))
}

impl Node for CorrespondenceFigure {
    type Params = CorrespondenceFigureParams;
    type Ports = CorrespondenceFigurePorts;
    const NAME: &'static str = "CorrespondenceFigure";
    const CLASS: Class = Class::Offline;

    fn shape(
        _: &CorrespondenceFigureParams,
        s: &mut Shape<'_, '_, CorrespondenceFigurePorts>,
    ) -> Result<(), Reject> {
        let audio = s.input(CorrespondenceFigurePorts::audio);
        if let (Some(db), Some(pairs)) =
            (s.value(CorrespondenceFigurePorts::database), s.value(CorrespondenceFigurePorts::pairs))
        {
            found(&audio, &db, &pairs)?;
        }
        s.ends(audio.end);
        Ok(())
    }

    fn build(_: &CorrespondenceFigureParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let audio = cx.input(CorrespondenceFigurePorts::audio);
        let db = cx.value(CorrespondenceFigurePorts::database);
        let pairs = cx.value(CorrespondenceFigurePorts::pairs);
        db.validate().map_err(|e| Fault::new("F111", e.to_string()).at("database"))?;
        let unit = db.unit() as f64 / db.conventions.rate.as_f64();
        let seconds = |range: std::ops::Range<usize>| [range.start, range.end].map(|k| k as f64 * unit);
        let mark = |interval: Interval| Mark {
            label: pairs.pairs.get(interval.correspondence).map(|c| c.label.clone()).unwrap_or_default(),
            channel: interval.vector,
            target: seconds(interval.target),
            recordings: seconds(interval.database),
        };
        let marks = found(&audio, &db, &pairs)?.into_iter().map(mark).collect();
        let frames = (unit * audio.rate.as_f64()).round().max(1.0) as usize;
        let step = frames as f64 / audio.rate.as_f64();
        let target = WaveformMeter::new(step, frames * usize::from(audio.format.0.max(1)));
        Ok(Self { target, marks })
    }

    fn run(&mut self, io: CorrespondenceFigureIo<'_>) -> Result<(), Fault> {
        self.target.add(io.audio.items());
        Ok(())
    }

    fn finish(&mut self, mut io: CorrespondenceFigureIo<'_>) -> Result<Summary, Fault> {
        let db = io.database;
        let step = db.unit() as f64 / db.conventions.rate.as_f64();
        let mut recordings = Waveform { step, extremes: Vec::new() };
        // Correspondences are counted in these units.
        let recorded = db.channel(0).get(..db.recorded() * db.unit()).unwrap_or_default();
        recordings.push(recorded, db.unit());
        let marks = std::mem::take(&mut self.marks);
        let summary = vec![("marks", marks.len().into())];
        io.figure.set(MarkedWaveforms { target: self.target.finish(), recordings, marks });
        Ok(summary)
    }

    archive_state!(target);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Channels;
    use crate::core::params::Params;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::feature::FeatureConventions;
    use crate::unit::{Augmentation, Take, build_augmented};
    use crate::warp::correspondence::set::read_correspondences;

    #[test]
    fn marks_stand_where_the_units_are_and_copies_are_left_out() {
        let noise = |n: usize| (0..n).map(|i| ((i * i) as f32 * 0.37).sin() * 0.5).collect::<Vec<f32>>();
        let takes = [Take { channels: vec![noise(8000)].into(), ..Take::default() }];
        let c = FeatureConventions::cloth(Rate::hz(8000), 80);
        let more = Augmentation { speeds: vec![1.25], gains: vec![-6.0] };
        let db = build_augmented(&takes, &c, None, &more).unwrap();
        assert_eq!((db.segments.len(), db.len()), (4, 2 * (100 + 80)));
        let text = "Correspondences(pairs: [(label: \"drag\", target: 0.5, source: 0, database: 0.25, duration: 0.1)])";
        let run = |pairs: &str, window: i64| {
            let node =
                Standalone::new::<CorrespondenceFigure>(CorrespondenceFigureParams::read(&|_| None).unwrap());
            node.input(CorrespondenceFigurePorts::audio, Rate::hz(16_000), Channels(2), noise(32_000))
                .value(CorrespondenceFigurePorts::database, db.clone())
                .value(CorrespondenceFigurePorts::pairs, read_correspondences(pairs).unwrap())
                .window(window)
                .run()
        };
        let second = crate::core::time::TICKS_PER_SECOND;
        let value = run(text, second / 7).unwrap().value(0).unwrap();
        let figure = value.get::<MarkedWaveforms>().unwrap();
        assert_eq!((figure.target.extremes.len(), figure.recordings.extremes.len()), (100, 100));
        assert_eq!(figure.marks.len(), 2, "one for each channel");
        let mark = &figure.marks[0];
        let near = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near(mark.target, [0.5, 0.6]) && near(mark.recordings, [0.25, 0.35]), "{mark:?}");
        assert_eq!(run(text, second).unwrap().value(0).unwrap().get::<MarkedWaveforms>(), Some(figure));
        let fault = run(&text.replace("target: 0.5", "target: 5.0"), second).err().unwrap();
        assert!(fault.code == "F110" && fault.message.contains("outside of the target"), "{fault}");
    }
}
