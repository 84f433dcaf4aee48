//! Gains that make levels continue where two blocks are joined.

use super::step::predecessor;
use crate::impl_state;
use crate::soundtrack::wavelet::TextureModel;
use crate::soundtrack::wavelet::envelope::frames;

/// Time in which a gain returns to 0 dB, s.
const RETURN: f64 = 0.35;

/// The greatest difference of the gains of neighbouring octaves, dB. Octaves of the transform overlap, and what one has of its neighbour cancels an alias
/// there: the more their gains differ, the more of it is heard.
const SLOPE: f32 = 2.0;

/// Gains by octave of the last block, which return to 0 dB from its beginning on.
///
/// At a join the level changes by two differences: that of the beginning from what would have followed, and that of what would have
/// preceded it from the end. The gain undoes the lesser of them, and nothing where they have opposite signs: the beginning of an event
/// within a block, before which there was none,
/// stays as it is. It raises no frame of an octave above the end of the block before, nor above the loudest frame of the recordings; the peak of a
/// sum of octaves may rise.
#[derive(Clone, Debug)]
pub struct JoinGains {
    /// The greatest magnitude of a gain, dB.
    limit: f32,
    /// Share of a gain that remains at the end of a block.
    remains: f32,
    /// At the beginning of the last block and at its end, dB, by octave, the finest ones.
    gains: Vec<[f32; 2]>,
}

impl JoinGains {
    /// Gains before the first block.
    pub fn new(model: &TextureModel, limit: f64) -> Self {
        let block = model.tree.span(0) as f64 / model.tree.rate;
        let remains = (1.0 - block / RETURN).max(0.0) as f32;
        Self { limit: limit.max(0.0) as f32, remains, gains: vec![[0.0; 2]; model.envelopes.bands()] }
    }

    /// Continues from the gains of another texture. Allocates nothing.
    pub fn follow(&mut self, other: &Self) {
        self.gains.iter_mut().zip(&other.gains).for_each(|(own, other)| *own = *other);
    }

    /// Continues with the next block. `join`: the root of the model that the block before ended with, and the root that this one begins with; without it
    /// levels need not continue.
    pub fn advance(&mut self, model: &TextureModel, join: Option<(u32, u32)>) {
        let roots = join.map_or([None; 4], |(last, next)| {
            [Some(last), follower(model, last), predecessor(model, 0, next, 1), Some(next)]
        });
        let edges = |root: Option<u32>| root.map_or(&[][..], |m| model.envelopes.edges(m));
        let [ended, followed, preceded, begins] = roots.map(edges);
        let first_level = model.tree.depth as usize - self.gains.len();
        for (octave, gain) in self.gains.iter_mut().enumerate() {
            let change = |from: &[[f32; 2]], to: &[[f32; 2]], edge: usize| {
                Some(to.get(octave)?[edge] - from.get(octave)?[edge])
            };
            let step = match (change(followed, begins, 0), change(ended, preceded, 1)) {
                (Some(a), Some(b)) if a * b <= 0.0 => 0.0,
                (Some(a), Some(b)) => a.signum() * a.abs().min(b.abs()),
                (a, b) => a.or(b).unwrap_or(0.0),
            };
            let mut start = (gain[1] - step).clamp(-self.limit, self.limit);
            if let Some((last, next)) = join.filter(|_| start > 0.0) {
                let frames = |root| frames(&model.tree, first_level + octave, root);
                let before = frames(last);
                let quarter = before.len().div_ceil(4);
                let end = gain[1] + before.rev().take(quarter).fold(f32::NEG_INFINITY, f32::max);
                let level = end.min(model.envelopes.loudest(octave));
                start = start.min(greatest_raise(frames(next), level, self.remains));
            }
            gain[0] = start;
        }
        limit_slope(&mut self.gains);
        self.gains.iter_mut().for_each(|gain| gain[1] = self.remains * gain[0]);
    }

    /// Applies the gains to the details of one channel of the last block in a level, one of `levels` levels.
    pub fn apply(&self, levels: usize, level: usize, details: &mut [f32]) {
        let octave = (level + self.gains.len()).checked_sub(levels);
        let Some([start, end]) = octave.and_then(|octave| self.gains.get(octave)).copied() else { return };
        if start == 0.0 {
            return;
        }
        let factor = |db: f32| 10_f64.powf(f64::from(db) / 20.0);
        let step = (end - start) / details.len() as f32;
        let (mut gain, ratio) = (factor(start + 0.5 * step), factor(step));
        for x in details {
            *x *= gain as f32;
            gain *= ratio;
        }
    }
}

/// The root that follows another one in its recording.
fn follower(model: &TextureModel, root: u32) -> Option<u32> {
    let source = model.tree.sources.get(model.tree.source_of(root))?;
    let next = root.checked_add(1)?;
    let end = source.first + source.roots;
    if next < end { Some(next) } else { source.wraps.then_some(source.first) }
}

/// The greatest gain in dB at the beginning of a block that raises none of its frames above a level.
fn greatest_raise(own: impl ExactSizeIterator<Item = f32>, level: f32, remains: f32) -> f32 {
    let step = (1.0 - remains) / own.len() as f32;
    let raises = own.enumerate().map(|(k, own)| (level - own).max(0.0) / (1.0 - k as f32 * step));
    raises.fold(f32::INFINITY, f32::min)
}

/// Lowers gains until those of neighbouring octaves differ by [`SLOPE`] at most, or by twice as much where one is above 0 dB and one below.
fn limit_slope(gains: &mut [[f32; 2]]) {
    for sign in [1.0, -1.0] {
        let limit = |neighbour: f32, gain: &mut [f32; 2]| {
            gain[0] = sign * (sign * gain[0]).min(neighbour + SLOPE);
            (sign * gain[0]).max(0.0)
        };
        gains.iter_mut().fold(f32::INFINITY, limit);
        gains.iter_mut().rev().fold(f32::INFINITY, limit);
    }
}

impl_state!(JoinGains { gains });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::soundtrack::wavelet::{ThresholdRules, TreeRecording, TreeRules, WaveletTree};

    /// A model of noise with a level in dB for each quarter of each block, in one recording that does not wrap; in the octaves of `levels` from
    /// the finest one on, as long as `octaves` goes, and 0 dB in others.
    fn model_in(levels: &[[f32; 4]], octaves: usize) -> TextureModel {
        let mut rng = Rng::new(4);
        let rules = TreeRules { block: Some(0.256), ..TreeRules::default() };
        // The recording fades from its end into its beginning for 20 ms.
        let noise = (0..levels.len() * 2048 + 160).map(|_| rng.between(-0.1, 0.1) as f32).collect();
        let recording = TreeRecording { name: "noise".into(), content: String::new(), channels: vec![noise] };
        let mut tree = WaveletTree::analyse(8000.0, &[recording], &rules).unwrap();
        assert_eq!((tree.roots(), tree.span(0)), (levels.len(), 2048));
        let depth = tree.details.len();
        for (level, details) in tree.details.iter_mut().enumerate() {
            for (k, x) in details.iter_mut().enumerate() {
                let (root, quarter) = (k >> level, (4 * (k % (1 << level))) >> level);
                let is_other = level + octaves < depth;
                *x = if is_other { 1.0 } else { 10_f32.powf(levels[root][quarter] / 20.0) };
            }
        }
        tree.sources[0].wraps = false;
        TextureModel::new(tree, &ThresholdRules::default())
    }

    /// The same in all octaves.
    fn model(levels: &[[f32; 4]]) -> TextureModel {
        model_in(levels, usize::MAX / 2)
    }

    /// The gain of the finest octave at the beginning and at the end of a block, dB.
    fn gains(joins: &JoinGains, model: &TextureModel) -> [f32; 2] {
        let levels = model.tree.depth as usize;
        let mut details = vec![1.0_f32; 1 << (levels - 1)];
        joins.apply(levels, levels - 1, &mut details);
        [details[0], details[details.len() - 1]].map(|x| 20.0 * x.log10())
    }

    fn is_near(found: [f32; 2], expected: [f32; 2]) -> bool {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.05)
    }

    #[test]
    fn levels_go_on_and_gains_return() {
        let model = model(&[[0.0; 4], [0.0; 4], [-5.0; 4], [-5.0; 4], [-30.0; 4], [-30.0; 4]]);
        let mut joins = JoinGains::new(&model, 15.0);
        joins.advance(&model, None);
        assert_eq!(gains(&joins, &model), [0.0; 2]);
        joins.advance(&model, Some((0, 1)));
        assert_eq!(gains(&joins, &model), [0.0; 2], "the same recording goes on");
        // The first block with -5 dB follows one with 0 dB in the recording; the second does not.
        joins.advance(&model, Some((0, 3)));
        let remains = 1.0_f32 - 0.256 / 0.35;
        assert!(is_near(gains(&joins, &model), [5.0, remains * 5.0]), "{:?}", gains(&joins, &model));
        let mut other = JoinGains::new(&model, 15.0);
        other.follow(&joins);
        joins.advance(&model, Some((3, 1)));
        let start = remains * 5.0 - 5.0;
        assert!(is_near(gains(&joins, &model), [start, remains * start]), "{:?}", gains(&joins, &model));
        // Steps of 25 dB down and 30 dB up are more than the limit.
        joins.advance(&model, Some((1, 5)));
        assert!(is_near(gains(&joins, &model), [15.0, remains * 15.0]), "{:?}", gains(&joins, &model));
        joins.advance(&model, Some((5, 1)));
        assert!(is_near(gains(&joins, &model), [-15.0, remains * -15.0]), "{:?}", gains(&joins, &model));
        other.advance(&model, Some((3, 1)));
        other.advance(&model, Some((1, 5)));
        other.advance(&model, Some((5, 1)));
        assert_eq!(gains(&joins, &model), gains(&other, &model));
        let mut without = JoinGains::new(&model, -1.0);
        without.advance(&model, Some((0, 3)));
        assert_eq!(gains(&without, &model), [0.0; 2]);
    }

    #[test]
    fn events_keep_their_beginnings_and_ends() {
        // An event of 20 dB from the beginning of a block to its end, with equal levels before and after it.
        let model = model(&[[0.0; 4], [20.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]]);
        for (last, next) in [(3, 1), (1, 3), (1, 2)] {
            let mut joins = JoinGains::new(&model, 15.0);
            joins.advance(&model, Some((last, next)));
            assert_eq!(gains(&joins, &model), [0.0; 2], "{last} {next}");
        }
    }

    #[test]
    fn no_frame_is_raised_above_the_end_before() {
        // The second block is 10 dB down, and rises to 2 dB below the first in its last quarter.
        let rising = [-10.0, -10.0, -10.0, -2.0];
        let model = model(&[[0.0; 4], [0.0; 4], [-10.0; 4], rising, [-10.0; 4]]);
        let mut joins = JoinGains::new(&model, 15.0);
        joins.advance(&model, Some((0, 3)));
        let remains = 1.0_f32 - 0.256 / 0.35;
        let at_quarter = 1.0 - 0.75 * (1.0 - remains);
        let start = 2.0 / at_quarter;
        assert!(is_near(gains(&joins, &model), [start, remains * start]), "{:?}", gains(&joins, &model));
    }

    #[test]
    fn gains_of_neighbouring_octaves_differ_little() {
        let levels = [[0.0; 4], [0.0; 4], [-10.0; 4], [-10.0; 4]];
        for (octaves, expected) in [(1, SLOPE), (2, 2.0 * SLOPE), (usize::MAX / 2, 10.0)] {
            for (join, sign) in [((0, 3), 1.0), ((3, 1), -1.0)] {
                let model = model_in(&levels, octaves);
                let mut joins = JoinGains::new(&model, 15.0);
                joins.advance(&model, Some(join));
                assert!((gains(&joins, &model)[0] - sign * expected).abs() < 0.05, "{octaves} {join:?}");
                let steps = joins.gains.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs());
                assert!(steps.fold(0.0, f32::max) <= SLOPE + 1e-6, "{octaves} {join:?}");
            }
        }
    }
}
