//! What is heard where sound fails to arrive.

/// Bridges gaps in a stream without clicks: the last frame decays on a straight line, and what comes after is let in on one.
#[derive(Clone, Debug)]
pub struct Dropout {
    held: Vec<f32>,
    level: f64,
    step: f64,
    begun: bool,
}

impl Dropout {
    /// A bridge that starts as sound does, `ramp` frames from full level to silence.
    #[must_use]
    pub fn new(channels: usize, ramp: usize) -> Self {
        Self { held: vec![0.0; channels.max(1)], level: 1.0, step: 1.0 / ramp.max(1) as f64, begun: false }
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
        }
    }

    /// Lets sound through, from the level that the gap before it has left.
    pub fn sound(&mut self, frames: &mut [f32]) {
        let channels = self.held.len();
        if self.level < 1.0 {
            for frame in frames.chunks_exact_mut(channels) {
                self.level = (self.level + self.step).min(1.0);
                let level = self.level as f32;
                frame.iter_mut().for_each(|x| *x *= level);
                if self.level >= 1.0 {
                    break;
                }
            }
        }
        if let Some(last) = frames.chunks_exact(channels).last() {
            self.held.copy_from_slice(last);
            self.begun = true;
        }
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
    fn sound_without_gaps_stays_as_it_is() {
        let mut dropout = Dropout::new(1, 10);
        let mut out = vec![0.3, -0.2, 0.9];
        dropout.sound(&mut out);
        assert_eq!(out, [0.3, -0.2, 0.9]);
    }
}
