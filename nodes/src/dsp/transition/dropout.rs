//! Concealment of dropouts.

/// Conceals gaps in a stream without clicks: the last frame before a gap fades out linearly, and the sound after it fades in.
#[derive(Clone, Debug)]
pub struct Dropout {
    last_frame: Vec<f32>,
    level: f64,
    step: f64,
    started: bool,
    /// The last frame of a sound that was cut off, and its current level.
    cut_frame: Vec<f32>,
    cut_level: f64,
}

impl Dropout {
    /// Creates a state before any sound. A fade takes `ramp` frames.
    #[must_use]
    pub fn new(channels: usize, ramp: usize) -> Self {
        let channels = channels.max(1);
        let step = 1.0 / ramp.max(1) as f64;
        let (last_frame, cut_frame) = (vec![0.0; channels], vec![0.0; channels]);
        Self { last_frame, level: 1.0, step, started: false, cut_frame, cut_level: 0.0 }
    }

    /// Marks a discontinuity: the sound before it fades out while the sound after it fades in.
    pub fn cut(&mut self) {
        let (level, cut_level) = (self.level as f32, self.cut_level as f32);
        let frames = self.cut_frame.iter_mut().zip(&self.last_frame);
        frames.for_each(|(cut, last)| *cut = *cut * cut_level + last * level);
        (self.level, self.cut_level) = (0.0, 1.0);
        self.last_frame.fill(0.0);
    }

    /// Fills a gap. Before the first sound it writes silence.
    pub fn gap(&mut self, out: &mut [f32]) {
        if !self.started {
            return out.fill(0.0);
        }
        for frame in out.chunks_exact_mut(self.last_frame.len()) {
            self.level = (self.level - self.step).max(0.0);
            let level = self.level as f32;
            frame.iter_mut().zip(&self.last_frame).for_each(|(x, last)| *x = last * level);
            add_cut(&mut self.cut_level, self.step, &self.cut_frame, frame);
        }
    }

    /// Passes sound through; after a gap it fades in from the level that the gap reached.
    pub fn sound(&mut self, frames: &mut [f32]) {
        let channels = self.last_frame.len();
        if let Some(last) = frames.chunks_exact(channels).last() {
            self.last_frame.copy_from_slice(last);
            self.started = true;
        }
        for frame in frames.chunks_exact_mut(channels) {
            if self.level >= 1.0 && self.cut_level <= 0.0 {
                break;
            }
            self.level = (self.level + self.step).min(1.0);
            let level = self.level as f32;
            frame.iter_mut().for_each(|x| *x *= level);
            add_cut(&mut self.cut_level, self.step, &self.cut_frame, frame);
        }
    }
}

/// Adds the fade-out of a sound that was cut off.
fn add_cut(level: &mut f64, step: f64, cut: &[f32], frame: &mut [f32]) {
    if *level > 0.0 {
        *level = (*level - step).max(0.0);
        frame.iter_mut().zip(cut).for_each(|(x, cut)| *x += cut * *level as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_fades_out_and_in_again() {
        let mut dropout = Dropout::new(2, 10);
        let mut out = vec![0.8_f32; 100];
        dropout.sound(&mut out[..40]);
        dropout.gap(&mut out[40..80]);
        dropout.sound(&mut out[80..]);
        assert!(out[..40].iter().all(|x| *x == 0.8));
        assert!(out[60..80].iter().all(|x| *x == 0.0));
        let steps = out.iter().step_by(2).zip(out.iter().step_by(2).skip(1)).map(|(a, b)| (a - b).abs());
        assert!(steps.fold(0.0, f32::max) < 0.0801);
        assert_eq!(out[99], 0.8);
    }

    #[test]
    fn a_discontinuity_leaves_no_step() {
        let mut dropout = Dropout::new(1, 10);
        let mut out: Vec<f32> = (0..60).map(|n| if n < 20 { 0.8 } else { -0.6 }).collect();
        dropout.sound(&mut out[..20]);
        dropout.cut();
        dropout.sound(&mut out[20..25]);
        dropout.cut();
        dropout.gap(&mut out[25..30]);
        dropout.sound(&mut out[30..]);
        let steps = out.windows(2).map(|w| (w[1] - w[0]).abs());
        assert!(steps.fold(0.0, f32::max) < 0.1501, "{out:?}");
        assert_eq!((out[19], out[59]), (0.8, -0.6));
    }

    #[test]
    fn sound_without_gaps_is_unchanged() {
        let mut dropout = Dropout::new(1, 10);
        let mut out = vec![0.3, -0.2, 0.9];
        dropout.sound(&mut out);
        assert_eq!(out, [0.3, -0.2, 0.9]);
    }
}
