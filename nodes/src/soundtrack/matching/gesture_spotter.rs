//! The node `GestureSpotter`.

use super::pattern::{Grid, Pattern, Scratch};
use super::query_params::QueryParams;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary};
use crate::core::params::Params;
use crate::core::ports::{Stream, Value};
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::soundtrack::motion::MotionCurve;
use crate::{archive_state, impl_state, params, ports};

params! {
    /// Recognises a gesture in a motion in real time: `weight` rises when the motion was similar to the query.
    ///
    /// At each frame the parts of the motion that end there, from half to twice the length of the query, are compared with it as by `MotionQuery`. A part
    /// that is similar enough is recognised at once, and the next one does not overlap it. A `MotionQuery` over the whole motion takes the most similar
    /// of parts that overlap; here a gesture is recognised as soon as its beginning is similar enough, and one that overlaps it is missed.
    ///
    /// # Complexity
    /// Per frame at most nine comparisons, of the frames of the query times twice the radius; most end at a lower bound.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 5.2, for motions that are complete. This form is ours.
    pub struct GestureSpotterParams {
        /// The query.
        [group] query: QueryParams;
        /// Channels of the motion and of the query.
        channels: u16 = 1, unit "", range 1..=1024_u16;
        /// Duration of the weight after the gesture; None for the length of the query.
        hold: Option<f64> = None, unit "s", range 0.0..=3600.0;
        /// The weight of a gesture.
        gain: f64 = 1.0, unit "", range -1.0..=1.0;
        /// The weight without one.
        rest: f64 = 0.0, unit "", range -1.0..=1.0;
    }
}
ports! {
    pub struct GestureSpotterPorts / GestureSpotterIo {
        in {
            /// The motion.
            motion: Stream<f32>,
            /// The motion that the query is a part of.
            query: Value<MotionCurve>,
        }
        out {
            /// `gain` from the end of each gesture on, `rest` otherwise.
            weight: Stream<f32>,
            /// Similarity of the most similar part that ends at the frame; 0 below the threshold.
            similarity: Stream<f32>,
        }
    }
}

/// Longest query, frames.
const MAX_FRAMES: f64 = 100_000.0;

/// The last gesture of a motion that comes frame by frame.
struct Spotter {
    pattern: Pattern,
    grids: Vec<Grid>,
    scratch: Scratch,
    /// Frame of the last gesture.
    last: Option<i64>,
}

impl Spotter {
    fn new(pattern: Pattern) -> Self {
        let lengths = pattern.lengths(usize::MAX);
        let grids: Vec<Grid> = lengths.into_iter().map(|len| Grid::new(len, pattern.frames)).collect();
        let mut scratch = Scratch::default();
        // The buffers have their room before the first frame.
        if let Some(grid) = grids.last() {
            let zeros = vec![0.0; grid.len * pattern.channels];
            let _ = pattern.compare(grid, &zeros, &mut scratch, f64::INFINITY);
        }
        Self { pattern, grids, scratch, last: None }
    }

    /// Compares the parts of a motion that end at a frame, the last of `past`. Returns the similarity of the most similar one if it reaches the
    /// threshold, and true if a gesture is recognised: a part that is similar enough and does not overlap the last one.
    fn next(&mut self, frame: i64, past: &[f32]) -> (Option<f64>, bool) {
        let width = self.pattern.channels;
        let mut least = None;
        let mut is_new = false;
        for grid in &self.grids {
            // What is before the first frame is no motion.
            if grid.len as i64 > frame + 1 || grid.len * width > past.len() {
                continue;
            }
            let window = &past[past.len() - grid.len * width..];
            let most = least.unwrap_or(self.pattern.most);
            if let Some(squared) = self.pattern.compare(grid, window, &mut self.scratch, most) {
                least = Some(squared);
                is_new |= self.last.is_none_or(|last| frame - grid.len as i64 >= last);
            }
        }
        if is_new {
            self.last = Some(frame);
        }
        (least.map(|squared| self.pattern.similarity(squared)), is_new)
    }
}

/// The node over [`Pattern::compare`].
pub struct GestureSpotter {
    spotter: Spotter,
    /// Frames that the weight holds.
    hold: i64,
    /// Weights without a gesture and after one.
    levels: [f32; 2],
    count: u64,
}

impl Node for GestureSpotter {
    type Params = GestureSpotterParams;
    type Ports = GestureSpotterPorts;
    const NAME: &'static str = "GestureSpotter";
    const CLASS: Class = Class::Worker;
    const COST: f64 = 50.0;

    fn shape(p: &GestureSpotterParams, s: &mut Shape<'_, '_, GestureSpotterPorts>) -> Result<(), Reject> {
        let motion = s.input(GestureSpotterPorts::motion);
        if motion.format.0 != p.channels {
            let message =
                format!("the motion has {} channels, `channels` is {}", motion.format.0, p.channels);
            return Err(Reject::new("F157", message).at("channels"));
        }
        let (from, to) = p.query.interval();
        let frames = (to - from) * motion.rate.as_f64() * p.query.longest;
        if to <= from || frames > MAX_FRAMES {
            let message = format!(
                "the query is from {from} s to {to} s; up to {MAX_FRAMES} frames with `longest` are compared"
            );
            return Err(Reject::new("F157", message)
                .at("to")
                .help("give an interval that ends after its start"));
        }
        // Rounding may give one frame more.
        s.lookaround(GestureSpotterPorts::motion, frames.ceil() as usize + 1, 0);
        s.output(GestureSpotterPorts::weight, motion.rate, Channels(1));
        s.output(GestureSpotterPorts::similarity, motion.rate, Channels(1));
        Ok(())
    }

    fn build(p: &GestureSpotterParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (motion, query) = (cx.input(GestureSpotterPorts::motion), cx.value(GestureSpotterPorts::query));
        let (rate, channels) = (motion.rate.as_f64(), usize::from(motion.format.0));
        if query.channels != channels {
            let message = format!("the query has {} channels, the motion {channels}", query.channels);
            return Err(Fault::new("F157", message).at("query"));
        }
        let pattern = Pattern::new(&query.at_rate(rate), p.query.interval(), p.query.rules())
            .map_err(|e| Fault::new("F157", e.to_string()).at("from"))?;
        let hold = p.hold.map_or(pattern.frames as f64, |hold| (hold * rate).round()) as i64;
        let levels = [p.rest, p.gain].map(|x| x as f32);
        Ok(Self { spotter: Spotter::new(pattern), hold: hold.max(1), levels, count: 0 })
    }

    fn run(&mut self, mut io: GestureSpotterIo<'_>) -> Result<(), Fault> {
        let (first, behind, width) = (io.motion.first(), io.motion.behind(), io.motion.width());
        let around = io.motion.around();
        for k in 0..io.weight.len() {
            let frame = first + k as i64;
            let (similarity, is_new) = self.spotter.next(frame, &around[..(behind + k + 1) * width]);
            self.count += u64::from(is_new);
            let is_on = self.spotter.last.is_some_and(|last| frame < last + self.hold);
            io.weight.items()[k] = self.levels[usize::from(is_on)];
            io.similarity.items()[k] = similarity.unwrap_or(0.0) as f32;
        }
        Ok(())
    }

    fn finish(&mut self, _: GestureSpotterIo<'_>) -> Result<Summary, Fault> {
        Ok(vec![("gestures", self.count.into())])
    }

    archive_state!(spotter, count);

    fn trial(rng: &mut Rng) -> (GestureSpotterParams, MemoryFiles) {
        let p = GestureSpotterParams::trial(rng);
        let query = p.query.clone().for_trial(rng);
        (GestureSpotterParams { query, channels: 1, ..p }, MemoryFiles::default())
    }
}

impl_state!(Spotter { last });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::computation::unmonitored;
    use crate::core::standalone::Standalone;
    use crate::core::time::{Rate, ticks};
    use crate::soundtrack::matching::{QueryRules, best_matches};

    const RATE: Rate = Rate::hz(50);

    /// A random motion with a gesture at 2 s, 6 s (as fast again) and 10 s (half as fast).
    fn motion() -> MotionCurve {
        let mut rng = Rng::new(4);
        let mut x = 0.0;
        let mut values: Vec<f32> = (0..700)
            .map(|_| {
                x = 0.98 * x + rng.between(-0.03, 0.03);
                x as f32
            })
            .collect();
        for (start, frames) in [(100, 50), (300, 25), (500, 100)] {
            for k in 0..frames {
                let t = f64::from(k) / f64::from(frames);
                values[start + k as usize] +=
                    (2.0 * (9.0 * t).sin() * (std::f64::consts::PI * t).sin()) as f32;
            }
        }
        MotionCurve { rate: 50.0, channels: 1, values, gaps: Vec::new() }
    }

    fn spotter(p: GestureSpotterParams) -> Standalone {
        let motion = motion();
        Standalone::new::<GestureSpotter>(p)
            .input(GestureSpotterPorts::motion, RATE, Channels(1), motion.values.clone())
            .value(GestureSpotterPorts::query, motion)
    }

    fn params() -> GestureSpotterParams {
        let read = |field: &str| match field {
            "from" => Some(crate::core::params::Datum::Float(2.0)),
            "to" => Some(crate::core::params::Datum::Float(3.0)),
            _ => None,
        };
        GestureSpotterParams::read(&read).unwrap()
    }

    #[test]
    fn gestures_are_recognised_at_their_ends() {
        let run = spotter(params()).run().unwrap();
        let weight = run.stream(GestureSpotterPorts::weight);
        let rises: Vec<usize> =
            (1..weight.len()).filter(|k| weight[*k] == 1.0 && weight[k - 1] == 0.0).collect();
        assert_eq!(rises.len(), 3, "{rises:?}");
        for (rise, end) in rises.iter().zip([150_usize, 325, 600]) {
            // The beginning of a slow gesture is similar already.
            assert!(rise.abs_diff(end) <= 25, "{rise} {end}");
        }
        // They hold for the length of the query.
        assert_eq!(weight.iter().filter(|w| **w == 1.0).count(), 150);
        // The same are found over the whole motion, each with at least this similarity.
        let rules = QueryRules::default();
        let all = best_matches(&motion(), &motion(), (2.0, 3.0), rules, &unmonitored).unwrap();
        assert_eq!(all.len(), 3, "{all:?}");
        let similarity = run.stream(GestureSpotterPorts::similarity);
        for found in &all {
            let end = (found.to * 50.0).round() as usize - 1;
            assert!(
                (f64::from(similarity[end]) - found.similarity).abs() < 1e-4,
                "{found:?} {}",
                similarity[end]
            );
        }
    }

    #[test]
    fn windows_of_any_length_give_the_same_weights() {
        let whole = spotter(params()).run().unwrap().stream(GestureSpotterPorts::similarity);
        for seconds in [0.02, 0.13, 1.7] {
            let run = spotter(params()).window(ticks(seconds)).run().unwrap();
            assert_eq!(run.stream(GestureSpotterPorts::similarity), whole, "{seconds}");
        }
    }

    #[test]
    fn a_query_may_have_another_rate() {
        let all = motion();
        let slow = MotionCurve {
            rate: 25.0,
            values: all.values.iter().copied().step_by(2).collect(),
            ..all.clone()
        };
        let run = Standalone::new::<GestureSpotter>(params())
            .input(GestureSpotterPorts::motion, RATE, Channels(1), all.values)
            .value(GestureSpotterPorts::query, slow)
            .run()
            .unwrap();
        assert_eq!(run.summary, [("gestures", 3_u64.into())]);
    }

    #[test]
    fn queries_that_do_not_fit_are_named() {
        let to = |to: f64| {
            let p = params();
            GestureSpotterParams { query: QueryParams { to, ..p.query.clone() }, ..p }
        };
        let e = spotter(to(1.0)).shape().unwrap_err();
        assert!(e.code == "F157" && e.field.as_deref() == Some("to"), "{e}");
        let e = spotter(to(99.0)).run().err().unwrap();
        assert!(e.message.contains("the curve ends at 14.000 s"), "{e}");
    }
}
