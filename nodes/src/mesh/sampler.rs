//! Irregular frames onto a regular grid: linear in time between the two neighbouring frames.

use super::{FrameReader, MeshClip, MeshError};

/// Times closer than this are the same frame, in seconds.
const SAME: f64 = 1e-9;

/// Positions of a clip at any time, reading each frame once when time goes forward.
///
/// Before the first frame and after the last the clip stands still.
#[derive(Clone, Debug)]
pub struct FrameSampler {
    times: Vec<f64>,
    held: [Option<usize>; 2],
    frames: [Vec<[f32; 3]>; 2],
}

impl FrameSampler {
    /// A sampler for the frames of `clip`; it holds two of them.
    #[must_use]
    pub fn new(clip: &MeshClip) -> Self {
        let frame = vec![[0.0; 3]; clip.vertex_count()];
        Self { times: clip.times().to_vec(), held: [None; 2], frames: [frame.clone(), frame] }
    }

    /// Writes the positions at `time` (seconds): a stored frame when the times agree within 1 ns, else the blend of
    /// its neighbours.
    ///
    /// # Errors
    /// Those of the reader, and a time that is not finite.
    ///
    /// # Complexity
    /// O(log frames + vertices), at most two reads, no allocation of its own.
    pub fn sample<R: FrameReader + ?Sized>(
        &mut self,
        reader: &mut R,
        time: f64,
        out: &mut [[f32; 3]],
    ) -> Result<(), MeshError> {
        if !time.is_finite() {
            return Err(MeshError::Parameter { name: "time", value: time, expected: "finite" });
        }
        if out.len() != self.frames[0].len() {
            return Err(MeshError::OutputLength { found: out.len(), expected: self.frames[0].len() });
        }
        let last = self.times.len() - 1;
        let after = self.times.partition_point(|&t| t <= time + SAME);
        let a = after.saturating_sub(1);
        let (t, b) = (self.times[a], (a + 1).min(last));
        let way = if a == b || time <= t + SAME { 0.0 } else { (time - t) / (self.times[b] - t) };
        let first = self.hold(reader, a, b)?;
        if way <= 0.0 {
            out.copy_from_slice(&self.frames[first]);
            return Ok(());
        }
        let second = self.hold(reader, b, a)?;
        for (o, (p, q)) in out.iter_mut().zip(self.frames[first].iter().zip(&self.frames[second])) {
            for k in 0..3 {
                o[k] = (f64::from(p[k]) + (f64::from(q[k]) - f64::from(p[k])) * way) as f32;
            }
        }
        Ok(())
    }

    /// Slot that holds `frame`, read over a slot that does not hold `keep`.
    fn hold<R: FrameReader + ?Sized>(
        &mut self,
        reader: &mut R,
        frame: usize,
        keep: usize,
    ) -> Result<usize, MeshError> {
        if let Some(slot) = self.held.iter().position(|&h| h == Some(frame)) {
            return Ok(slot);
        }
        let slot = usize::from(self.held[0] == Some(keep));
        self.held[slot] = None;
        reader.read_frame(frame, &mut self.frames[slot])?;
        self.held[slot] = Some(frame);
        Ok(slot)
    }
}

/// The usual frame rate (frames, per seconds) that the times are spaced by, if there is one.
///
/// The typical interval is the mean of those within 5 % of the median: a missing frame does not disturb it, and times
/// rounded to f32 average out. Rates are 24, 25, 30, 48, 50, 60, 120, 240 and 1000/1001 of 24, 30, 48, 60, 120, 240,
/// to within 1e-4.
#[must_use]
pub fn nominal_rate(times: &[f64]) -> Option<(u64, u64)> {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() || steps.iter().any(|s| !s.is_finite() || *s <= 0.0) {
        return None;
    }
    steps.sort_unstable_by(f64::total_cmp);
    let median = steps[steps.len() / 2];
    let (sum, n) = steps
        .iter()
        .filter(|&&s| (s / median - 1.0).abs() < 0.05)
        .fold((0.0, 0u32), |(sum, n), s| (sum + s, n + 1));
    let rate = f64::from(n) / sum;
    const WHOLE: [u64; 8] = [24, 25, 30, 48, 50, 60, 120, 240];
    WHOLE
        .iter()
        .map(|&r| (r, 1))
        .chain(WHOLE.iter().filter(|&&r| r % 25 != 0).map(|&r| (r * 1000, 1001)))
        .find(|&(num, den)| (rate / (num as f64 / den as f64) - 1.0).abs() < 1e-4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    struct Line {
        reads: usize,
        times: Vec<f64>,
    }

    impl FrameReader for Line {
        fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
            self.reads += 1;
            out.fill([self.times[index] as f32, index as f32, 1.0]);
            Ok(())
        }
    }

    fn clip(times: &[f64]) -> (MeshClip, Line) {
        let topology = Topology { rest: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]] };
        (MeshClip::new(topology, times.to_vec(), 0).unwrap(), Line { reads: 0, times: times.to_vec() })
    }

    #[test]
    fn motion_that_is_linear_in_time_is_resampled_exactly() {
        let (clip, mut line) = clip(&[0.0, 0.125, 0.5, 1.0]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        for k in 0..=32 {
            let t = f64::from(k) / 32.0;
            sampler.sample(&mut line, t, &mut out).unwrap();
            assert_eq!(out[1][0], t as f32);
        }
        assert_eq!(line.reads, 4, "each frame is read once going forward");
    }

    #[test]
    fn a_time_within_a_nanosecond_gives_the_stored_frame() {
        let (clip, mut line) = clip(&[0.0, 0.1, 0.2]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        for t in [0.1 - 9e-10, 0.1, 0.1 + 9e-10] {
            sampler.sample(&mut line, t, &mut out).unwrap();
            assert_eq!(out[0], [0.1, 1.0, 1.0]);
        }
    }

    #[test]
    fn outside_of_the_clip_its_ends_stand_still() {
        let (clip, mut line) = clip(&[1.0, 2.0]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        sampler.sample(&mut line, -5.0, &mut out).unwrap();
        assert_eq!(out[0][1], 0.0);
        sampler.sample(&mut line, 5.0, &mut out).unwrap();
        assert_eq!(out[0][1], 1.0);
        assert!(sampler.sample(&mut line, f64::NAN, &mut out).is_err());
    }

    #[test]
    fn usual_rates_are_recognised_and_others_are_not() {
        for (num, den) in [
            (24, 1),
            (25, 1),
            (30, 1),
            (50, 1),
            (60, 1),
            (240, 1),
            (24000, 1001),
            (30000, 1001),
            (60000, 1001),
        ] {
            let times: Vec<f64> = (0..200).map(|k| f64::from(k) * den as f64 / num as f64).collect();
            assert_eq!(nominal_rate(&times), Some((num, den)));
            // As MDD stores them, with a frame missing.
            let mut rounded: Vec<f64> = times.iter().map(|&t| f64::from(t as f32)).collect();
            rounded.remove(77);
            assert_eq!(nominal_rate(&rounded), Some((num, den)), "f32");
        }
        assert_eq!(nominal_rate(&[0.0, 1.0 / 37.0, 2.0 / 37.0]), None);
        assert_eq!(nominal_rate(&[0.0]), None);
        assert_eq!(nominal_rate(&[0.0, 0.0]), None);
    }
}
