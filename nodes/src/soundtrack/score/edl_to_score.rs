//! The node `EdlToScore`.

use super::edit_list::{EditList, EditRules, edits_to_score, read_edits};
use super::model::SoundScore;
use crate::artefact::value_file::Artefact;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::{params, ports};

params! {
    /// Makes a score of the edit list of a recut picture: the sound of the source follows its picture.
    ///
    /// Each interval of the source becomes a sound, and each edit a target with a constant weight. Lists are read in three formats, detected
    /// by their content: CMX 3600 (`.edl`), OpenTimelineIO (`.otio`), and CSV with the columns `target_from`, `target_to`, `source_from`,
    /// `source_to` (s) and, optionally, `recording` (the end of its path) and `weight` (-1 to 1).
    ///
    /// CMX 3600: the events with picture are read, or those with sound if no event has picture. OpenTimelineIO: the first video track,
    /// or the first track if there is no video. Transitions are cuts: a dissolve, wipe or key of CMX at its beginning, a transition of
    /// OpenTimelineIO in its middle. Speed changes and nested stacks are not followed: where source and target differ in length, both
    /// keep their lengths, and a warning names the line.
    ///
    /// # Source
    /// SMPTE ST 258:2004, "Transfer of Edit Decision Lists". OpenTimelineIO (Academy Software Foundation).
    pub struct EdlToScoreParams {
        /// The edit list.
        path: AssetPath;
        /// Frames per second of the timecodes of a CMX list. 23.98, 29.97 and 59.94 stand for 1000/1001 of 24, 30 and 60; drop-frame timecode
        /// needs 29.97 or 59.94.
        fps: f64 = 25.0, unit "Hz", range 1.0..=1000.0;
        /// Time of a sound in the recording after that of its picture in the source. Sound before the start of the recording is left out.
        av_offset: f64 = 0.0, unit "s", range -60.0..=60.0;
        /// Time in the list of the first frame of the source, such as 3600 for 01:00:00:00.
        source_start: f64 = 0.0, unit "s", range 0.0..=86400.0;
        /// Weight of edits without their own: 1 for hard inclusion of their sound, less for a probability.
        weight: f64 = 1.0, unit "", range 0.0..=1.0;
        /// Lets the first edit begin at 0 s.
        from_zero: bool = true;
    }
}
ports! {
    pub struct EdlToScorePorts / EdlToScoreIo {
        in {}
        out {
            /// The score.
            score: Value<SoundScore>,
        }
    }
}

/// The node over [`edits_to_score`].
#[derive(Debug)]
pub struct EdlToScore;

fn read(p: &EdlToScoreParams, bytes: &[u8]) -> Result<(EditList, SoundScore), Reject> {
    let wrong = |message: String| Reject::new("F156", format!("{:?}: {message}", p.path.0)).at("path");
    let rules = EditRules {
        fps: p.fps,
        av_offset: p.av_offset,
        source_start: p.source_start,
        weight: p.weight,
        from_zero: p.from_zero,
    };
    let list = read_edits(bytes, p.fps).map_err(|e| wrong(e.to_string()))?;
    let score = edits_to_score(&list.edits, &rules).map_err(wrong)?;
    Ok((list, SoundScore { file: p.path.0.clone(), ..score }))
}

impl Func for EdlToScore {
    type Params = EdlToScoreParams;
    type Ports = EdlToScorePorts;
    const NAME: &'static str = "EdlToScore";
    // Messages name the file.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &EdlToScoreParams, s: &mut Shape<'_, '_, EdlToScorePorts>) -> Result<(), Reject> {
        read(p, &s.bytes("path", &p.path.0)?).map(drop)
    }

    fn eval(p: &EdlToScoreParams, cx: &Build<'_>, mut io: EdlToScoreIo<'_>) -> Result<Summary, Fault> {
        let (list, score) = read(p, &cx.bytes("path", &p.path.0)?)?;
        let mut summary = Artefact::summary(&score);
        summary.push(("duration_s", score.duration.into()));
        summary.extend(list.notices.into_iter().map(|text| ("warning", text.into())));
        io.score.set(score);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (EdlToScoreParams, MemoryFiles) {
        let is_table = rng.below(2) == 0;
        let path = if is_table { "cut.csv" } else { "cut.edl" };
        let header = if is_table { "target_from,target_to,source_from,source_to\n" } else { "TITLE: CUT\n" };
        let mut text = header.to_owned();
        let mut at = 0;
        for number in 1..=1 + rng.below(8) {
            let (length, source) = (1 + rng.below(24), rng.below(9));
            let end = at + length;
            text += &if is_table {
                format!("{at},{end},{source},{}\n", source + length)
            } else {
                // In seconds of timecode, below a minute and then below an hour.
                let code = |s: usize| format!("00:{:02}:{:02}:00", s / 60, s % 60);
                let times = [source, source + length, at, end].map(code).join(" ");
                format!("{number:03} AX V C {times}\n* FROM CLIP NAME: clip {}\n", rng.below(3))
            };
            at = end;
        }
        let mut files = MemoryFiles::default();
        files.insert(path, text);
        let p = EdlToScoreParams {
            path: path.into(),
            fps: [23.98, 25.0, 60.0][rng.below(3)],
            av_offset: rng.between(-0.5, 0.5),
            source_start: 0.0,
            ..EdlToScoreParams::trial(rng)
        };
        (p, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;

    const CUT: &str = "001 A V C 01:00:02:00 01:00:03:00 10:00:00:00 10:00:01:00\n\
        002 A V C 01:00:02:00 01:00:03:00 10:00:01:00 10:00:01:12\n";

    fn standalone(p: impl Fn(EdlToScoreParams) -> EdlToScoreParams, text: &str) -> Standalone {
        let path = Datum::Text("cut.edl".into());
        let defaults = EdlToScoreParams::read(&|field| (field == "path").then(|| path.clone())).unwrap();
        let mut standalone =
            Standalone::func::<EdlToScore>(p(EdlToScoreParams { source_start: 3600.0, ..defaults }));
        standalone.files.insert("cut.edl", text);
        standalone
    }

    #[test]
    fn a_list_becomes_a_score_and_its_notices_are_warnings() {
        let run = standalone(|p| EdlToScoreParams { weight: 0.5, ..p }, CUT).run().unwrap();
        let score = run.value(EdlToScorePorts::score.index()).unwrap();
        let score = score.get::<SoundScore>().unwrap();
        let duration = score.duration.unwrap();
        assert!(score.file == "cut.edl" && (duration - 1.48).abs() < 1e-9, "{duration}");
        assert_eq!((score.sources.len(), score.sources[0].segments[0]), (1, (2.0, 3.0)));
        assert_eq!(score.targets[1].curve.points, [(1.0, 0.5), (duration, 0.5)]);
        let warnings: Vec<String> = run
            .summary
            .iter()
            .filter(|(name, _)| *name == "warning")
            .map(|(_, text)| text.to_string())
            .collect();
        assert!(
            warnings.len() == 1 && warnings[0].contains("line 2: the picture has another speed"),
            "{warnings:?}"
        );
    }

    #[test]
    fn a_wrong_list_is_named_before_the_run() {
        let reject =
            |p: fn(EdlToScoreParams) -> EdlToScoreParams, text| standalone(p, text).shape().unwrap_err();
        let e = reject(|p| p, "001 A V C 00:00:00:00 00:00:01:25 00:00:00:00 00:00:01:00\n");
        assert!(e.code == "F156" && e.field.as_deref() == Some("path"), "{e}");
        assert!(e.message.starts_with("\"cut.edl\": 1:23: \"00:00:01:25\"; a timecode"), "{e}");
        let e = reject(|p| EdlToScoreParams { source_start: 3603.0, ..p }, CUT);
        assert!(
            e.message.contains("line 1: the source begins at 3602 s") && e.message.contains("`source_start`")
        );
    }
}
