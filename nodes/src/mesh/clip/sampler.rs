//! Resampling of frames at any time by linear interpolation.

use super::{FrameReader, MeshClip, MeshError};

/// Times with a smaller difference are the same frame, s.
const TIME_TOLERANCE: f64 = 1e-9;

/// Positions of a clip at any time; each frame is read once if time increases.
///
/// Before the first frame and after the last the positions are constant.
#[derive(Clone, Debug)]
pub struct FrameSampler {
    times: Vec<f64>,
    /// Frame in each slot of `frames`.
    loaded: [Option<usize>; 2],
    frames: [Vec<[f32; 3]>; 2],
}

impl FrameSampler {
    /// A sampler for the frames of `clip`; it buffers two of them.
    #[must_use]
    pub fn new(clip: &MeshClip) -> Self {
        let frame = vec![[0.0; 3]; clip.vertex_count()];
        Self { times: clip.times().to_vec(), loaded: [None; 2], frames: [frame.clone(), frame] }
    }

    /// Writes the positions at `time` (seconds): a stored frame if the times agree within 1 ns, else the interpolation
    /// of the two adjacent frames.
    ///
    /// # Errors
    /// As the reader, and for a time that is not finite.
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
        let after = self.times.partition_point(|&t| t <= time + TIME_TOLERANCE);
        let a = after.saturating_sub(1);
        let (t, b) = (self.times[a], (a + 1).min(last));
        let fraction =
            if a == b || time <= t + TIME_TOLERANCE { 0.0 } else { (time - t) / (self.times[b] - t) };
        let first = self.load(reader, a, b)?;
        if fraction <= 0.0 {
            out.copy_from_slice(&self.frames[first]);
            return Ok(());
        }
        let second = self.load(reader, b, a)?;
        for (o, (p, q)) in out.iter_mut().zip(self.frames[first].iter().zip(&self.frames[second])) {
            for k in 0..3 {
                o[k] = (f64::from(p[k]) + (f64::from(q[k]) - f64::from(p[k])) * fraction) as f32;
            }
        }
        Ok(())
    }

    /// Slot of `frame`; if it is not loaded, it replaces the frame that is not `keep`.
    fn load<R: FrameReader + ?Sized>(
        &mut self,
        reader: &mut R,
        frame: usize,
        keep: usize,
    ) -> Result<usize, MeshError> {
        if let Some(slot) = self.loaded.iter().position(|&h| h == Some(frame)) {
            return Ok(slot);
        }
        let slot = usize::from(self.loaded[0] == Some(keep));
        self.loaded[slot] = None;
        reader.read_frame(frame, &mut self.frames[slot])?;
        self.loaded[slot] = Some(frame);
        Ok(slot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    struct LinearMotion {
        reads: usize,
        times: Vec<f64>,
    }

    impl FrameReader for LinearMotion {
        fn read_frame(&mut self, index: usize, out: &mut [[f32; 3]]) -> Result<(), MeshError> {
            self.reads += 1;
            out.fill([self.times[index] as f32, index as f32, 1.0]);
            Ok(())
        }
    }

    fn clip(times: &[f64]) -> (MeshClip, LinearMotion) {
        let topology = Topology { rest: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]] };
        (
            MeshClip::new(topology, times.to_vec(), 0).unwrap(),
            LinearMotion { reads: 0, times: times.to_vec() },
        )
    }

    #[test]
    fn motion_that_is_linear_in_time_is_resampled_exactly() {
        let (clip, mut reader) = clip(&[0.0, 0.125, 0.5, 1.0]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        for k in 0..=32 {
            let t = f64::from(k) / 32.0;
            sampler.sample(&mut reader, t, &mut out).unwrap();
            assert_eq!(out[1][0], t as f32);
        }
        assert_eq!(reader.reads, 4, "each frame is read once if time increases");
    }

    #[test]
    fn a_time_within_a_nanosecond_gives_the_stored_frame() {
        let (clip, mut reader) = clip(&[0.0, 0.1, 0.2]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        for t in [0.1 - 9e-10, 0.1, 0.1 + 9e-10] {
            sampler.sample(&mut reader, t, &mut out).unwrap();
            assert_eq!(out[0], [0.1, 1.0, 1.0]);
        }
    }

    #[test]
    fn outside_of_the_clip_positions_are_constant() {
        let (clip, mut reader) = clip(&[1.0, 2.0]);
        let mut sampler = FrameSampler::new(&clip);
        let mut out = [[0.0; 3]; 3];
        sampler.sample(&mut reader, -5.0, &mut out).unwrap();
        assert_eq!(out[0][1], 0.0);
        sampler.sample(&mut reader, 5.0, &mut out).unwrap();
        assert_eq!(out[0][1], 1.0);
        assert!(sampler.sample(&mut reader, f64::NAN, &mut out).is_err());
    }
}
