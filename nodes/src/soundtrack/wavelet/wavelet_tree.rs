//! The node `WaveletTree`.

use super::family::Wavelet;
use super::progression::progression;
use super::tree::{TreeError, TreeFit, TreeRecording, TreeRules, WaveletTree};
use crate::core::content::audio_digest;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::{AssetPath, Params};
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Rate;
use crate::io::{MaxLength, RecordingParam, Whole, recording_warnings, trial_wav};
use crate::{params, ports};

params! {
    /// Analyses recordings as trees of wavelet coefficients.
    ///
    /// The levels of a tree halve the time that a node covers: a root covers up to `block`, a leaf two samples. The transform is orthogonal and
    /// periodic, and each coefficient is centred on the time that its node covers.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 3. Dubnov, Bar-Joseph, El-Yaniv, Lischinski and Werman,
    /// "Synthesizing sound textures through wavelet tree learning" (IEEE CG&A 22(4), 2002).
    pub struct WaveletTreeParams {
        /// The recordings, of any rates and at most an hour each.
        recordings: Vec<AssetPath>;
        /// Rate to which recordings are resampled.
        rate: Rate = Rate::hz(48_000);
        /// Channels; recordings of others are averaged, or repeated. None for those of the first recording.
        channels: Option<u16> = None, unit "", range 1..=64_u16;
        /// The wavelet. `Sym5` is better localised in time than `Db5`.
        wavelet: Wavelet = Wavelet::Db5;
        /// Longest time that a root covers; None for the shorter of 0.5 s and an eighth of the shortest recording.
        block: Option<f64> = None, unit "s", range 0.0001..=60.0;
        /// Method by which a recording becomes a whole number of blocks.
        fit: TreeFit = TreeFit::Circular;
        /// Length of the fade from the end to the beginning with `fit: Circular`.
        crossfade: f64 = 0.02, unit "s", range 0.0..=1.0;
    }
}
ports! {
    pub struct WaveletTreePorts / WaveletTreeIo {
        in {}
        out {
            /// The trees of all recordings.
            tree: Value<WaveletTree>,
        }
    }
}

const RECORDINGS: RecordingParam =
    RecordingParam { name: "recordings", code: "F155", max: MaxLength::Seconds(3600) };
/// Share of samples without sound above which a warning appears.
const MAX_SILENCE: f64 = 0.25;

/// The node over [`WaveletTree`].
#[derive(Debug)]
pub struct WaveletTreeNode;

/// Averages or repeats channels.
fn with_channels(all: Vec<Vec<f32>>, wanted: usize) -> Vec<Vec<f32>> {
    match all.as_slice() {
        _ if all.len() == wanted => all,
        [one] => vec![one.clone(); wanted],
        _ => {
            let n = all.first().map_or(0, Vec::len);
            let mean = |k: usize| {
                all.iter().map(|x| x.get(k).copied().unwrap_or(0.0)).sum::<f32>() / all.len() as f32
            };
            vec![(0..n).map(mean).collect(); wanted]
        }
    }
}

impl Func for WaveletTreeNode {
    type Params = WaveletTreeParams;
    type Ports = WaveletTreePorts;
    const NAME: &'static str = "WaveletTree";
    // Recordings are named after their files.
    const EXPOSES_PATHS: bool = true;

    fn check(p: &WaveletTreeParams, s: &mut Shape<'_, '_, WaveletTreePorts>) -> Result<(), Reject> {
        if p.recordings.is_empty() {
            return Err(Reject::new("F155", "there is no recording")
                .at("recordings")
                .help("give at least one"));
        }
        RECORDINGS.check(s, &p.recordings);
        Ok(())
    }

    fn eval(p: &WaveletTreeParams, cx: &Build<'_>, mut io: WaveletTreeIo<'_>) -> Result<Summary, Fault> {
        let (mut recordings, mut warnings) = (Vec::with_capacity(p.recordings.len()), Summary::new());
        let mut channels = p.channels.map(usize::from);
        for (k, AssetPath(path)) in p.recordings.iter().enumerate() {
            if (cx.monitor)(k as f64 / p.recordings.len() as f64) {
                return Err(Fault::stopped());
            }
            let Whole { channels: all, samples, info } =
                RECORDINGS.read_whole(cx, &format!("recordings[{k}]"), path, p.rate)?;
            let wanted = *channels.get_or_insert(all.len());
            warnings.extend(recording_warnings(path, &info, &samples));
            let silent = samples.iter().filter(|x| **x == 0.0).count();
            if silent as f64 > MAX_SILENCE * samples.len() as f64 {
                let percent = 100.0 * silent as f64 / samples.len() as f64;
                warnings.push((
                    "warning",
                    format!("{path:?}: {percent:.0} % is digital silence: cut it off").into(),
                ));
            }
            let content = audio_digest(info.rate, info.channels, &samples);
            let channels = with_channels(all, wanted);
            if let Some(what) = channels.first().and_then(|x| progression(x, p.rate.as_f64())) {
                let text = format!(
                    "{path:?}: {what} over the recording: a sound that progresses loses this order when it is resynthesised"
                );
                warnings.push(("warning", text.into()));
            }
            recordings.push(TreeRecording { name: path.clone(), content, channels });
        }
        let rules = TreeRules { wavelet: p.wavelet, block: p.block, fit: p.fit, crossfade: p.crossfade };
        let tree = WaveletTree::analyse(p.rate.as_f64(), &recordings, &rules).map_err(|e| {
            let fault = Fault::new("F155", e.to_string()).at("recordings");
            match e {
                TreeError::Short { .. } => fault.help("leave it out, or give a shorter `block`"),
                _ => fault,
            }
        })?;
        let summary = vec![
            ("recordings", tree.sources.len().into()),
            ("channels", tree.channels.into()),
            ("levels", tree.depth.into()),
            ("roots", tree.roots().into()),
            ("block_s", (tree.span(0) as f64 / tree.rate).into()),
        ];
        io.tree.set(tree);
        Ok([summary, warnings].concat())
    }

    fn trial(rng: &mut Rng) -> (WaveletTreeParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let mut noise = |n: usize| (0..n).map(|_| rng.between(-0.5, 0.5) as f32).collect::<Vec<f32>>();
        files.insert("a.wav", trial_wav(&noise(3000), 8000));
        files.insert("b.wav", trial_wav(&noise(2000), 16_000));
        let p = WaveletTreeParams {
            recordings: vec!["a.wav".into(), "b.wav".into()],
            rate: Rate::hz(8000),
            channels: Some(1 + rng.below(2) as u16),
            block: Some(rng.between(0.001, 0.1)),
            crossfade: 0.005,
            ..WaveletTreeParams::trial(rng)
        };
        (p, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;

    fn standalone(samples: &[f32]) -> Standalone {
        let (p, _) = WaveletTreeNode::trial(&mut Rng::new(1));
        let p = WaveletTreeParams { recordings: vec!["a.wav".into()], channels: None, block: None, ..p };
        let mut standalone = Standalone::func::<WaveletTreeNode>(p);
        standalone.files.insert("a.wav", trial_wav(samples, 8000));
        standalone
    }

    fn warnings(samples: &[f32]) -> String {
        let run = standalone(samples).run().unwrap();
        run.summary.iter().filter(|(name, _)| *name == "warning").map(|(_, text)| text.to_string()).collect()
    }

    #[test]
    fn silence_and_progressions_are_warnings() {
        let mut rng = Rng::new(1);
        let noise: Vec<f32> = (0..16_000).map(|_| rng.between(-0.5, 0.5) as f32).collect();
        assert_eq!(warnings(&noise), "");
        let half: Vec<f32> = noise.iter().enumerate().map(|(k, x)| if k < 8000 { *x } else { 0.0 }).collect();
        assert!(warnings(&half).contains("50 % is digital silence"), "{}", warnings(&half));
        let rising: Vec<f32> =
            noise.iter().enumerate().map(|(k, x)| x * (k as f32 / 16_000.0 + 0.01)).collect();
        assert!(warnings(&rising).contains("level rises"), "{}", warnings(&rising));
    }

    #[test]
    fn short_recordings_are_named() {
        let error = |samples: &[f32]| standalone(samples).run().err().unwrap().to_string();
        assert!(error(&[0.1; 12]).contains("12 samples; at least 16"), "{}", error(&[0.1; 12]));
    }
}
