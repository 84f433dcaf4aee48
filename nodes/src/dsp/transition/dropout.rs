//! What is heard where sound fails to arrive.

/// Bridges gaps in a stream without clicks: the last frame decays on a straight line, and what comes after is let in on one.
#[derive(Clone, Debug)]
pub struct Dropout {
    held: Vec<f32>,
    level: f64,
    step: f64,
    begun: bool,
    /// The last frame of a sound that was cut off, and what is left of it.
    cut: Vec<f32>,
    left: f64,
}

impl Dropout {
    /// A bridge that starts as sound does, `ramp` frames from full level to silence.
    #[must_use]
    pub fn new(channels: usize, ramp: usize) -> Self {
        let channels = channels.max(1);
        let step = 1.0 / ramp.max(1) as f64;
        let (held, cut) = (vec![0.0; channels], vec![0.0; channels]);
        Self { held, level: 1.0, step, begun: false, cut, left: 0.0 }
    }

    /// What comes next has nothing to do with what came before: the one decays while the other is let in.
    pub fn cut(&mut self) {
        let (level, left) = (self.level as f32, self.left as f32);
        self.cut.iter_mut().zip(&self.held).for_each(|(cut, held)| *cut = *cut * left + held * level);
        (self.level, self.left) = (0.0, 1.0);
        self.held.fill(0.0);
    }

    /// Fills a gap; silence before the first sound is none.
    pub fn gap(&mut self, out: &mut [f32]) {
        if !self.begun {
            return out.fill(0.0);
        }
        for frame in out.chunks_exact_mut(self.held.len()) {
            self.level = (self.level - self.step).max(0.0);
            let level = self.level as f32;
            frame.iter_mut().zip(&self.held).for_each(|(x, held)| *x = held * level);
            fade_cut(&mut self.left, self.step, &self.cut, frame);
        }
    }

    /// Lets sound through, from the level that the gap before it has left.
    pub fn sound(&mut self, frames: &mut [f32]) {
        let channels = self.held.len();
        if let Some(last) = frames.chunks_exact(channels).last() {
            self.held.copy_from_slice(last);
            self.begun = true;
        }
        for frame in frames.chunks_exact_mut(channels) {
            if self.level >= 1.0 && self.left <= 0.0 {
                break;
            }
            self.level = (self.level + self.step).min(1.0);
            let level = self.level as f32;
            frame.iter_mut().for_each(|x| *x *= level);
            fade_cut(&mut self.left, self.step, &self.cut, frame);
        }
    }
}

/// Adds what is left of a sound that was cut off.
fn fade_cut(left: &mut f64, step: f64, cut: &[f32], frame: &mut [f32]) {
    if *left > 0.0 {
        *left = (*left - step).max(0.0);
        frame.iter_mut().zip(cut).for_each(|(x, cut)| *x += cut * *left as f32);
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
    fn one_sound_cut_off_by_another_leaves_no_step() {
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
    fn sound_without_gaps_stays_as_it_is() {
        let mut dropout = Dropout::new(1, 10);
        let mut out = vec![0.3, -0.2, 0.9];
        dropout.sound(&mut out);
        assert_eq!(out, [0.3, -0.2, 0.9]);
    }
}
