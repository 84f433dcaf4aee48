//! Modes that are left out because they are inaudible.

use std::f64::consts::TAU;

/// A damped mode with its gain at each contact point.
#[derive(Clone, Debug, PartialEq)]
pub struct Voice {
    /// Square of the angular frequency without damping, rad^2/s^2.
    pub lambda: f64,
    /// Damping `c`, 1/s.
    pub c: f64,
    /// Gain at each contact point.
    pub gains: Vec<f64>,
    /// Largest gain at any point of the surface.
    pub reach: f64,
    /// Modes of the model that it represents, with the sound of each per modal impulse: several after merging.
    pub members: Vec<(usize, f64)>,
}

impl Voice {
    /// Decay rate `d = c / 2` of the amplitude, 1/s.
    #[must_use]
    pub fn decay(&self) -> f64 {
        0.5 * self.c
    }

    /// Frequency with damping, Hz.
    #[must_use]
    pub fn frequency(&self) -> f64 {
        (self.lambda - self.decay().powi(2)).max(0.0).sqrt() / TAU
    }

    fn loudness(&self) -> f64 {
        self.gains.iter().fold(0.0, |m, g| m.max(g.abs()))
    }
}

/// Rules by which modes are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Culling {
    /// Lowest frequency, Hz.
    pub lowest: f64,
    /// Highest frequency, Hz.
    pub highest: f64,
    /// Largest gain on the surface relative to the loudest mode's, dB.
    pub floor: f64,
    /// Width of the bands in which modes are merged, in just noticeable differences of frequency; 0 for none.
    pub jnd_scale: f64,
    /// Leave modes that beat with each other apart.
    pub keep_beats: bool,
    /// Maximum number of modes.
    pub top: Option<usize>,
}

/// Numbers of modes left out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DropCounts {
    /// Outside of the band.
    pub band: usize,
    /// Damped so strongly that they do not oscillate.
    pub overdamped: usize,
    /// Too weak at every point of the surface.
    pub faint: usize,
    /// Merged with a neighbour.
    pub merged: usize,
    /// Weaker than the `top` strongest ones.
    pub weaker: usize,
}

/// Just noticeable difference of frequency, Hz.
///
/// # Source
/// Wier, Jesteadt and Green, "Frequency discrimination as a function of frequency and sensation level" (J. Acoust. Soc. Am. 61,
/// 1977), by its fit `log10 DL = 0.026 sqrt(f) - 0.533`.
#[must_use]
pub fn just_noticeable(frequency: f64) -> f64 {
    libm::exp10(0.026 * frequency.sqrt() - 0.533)
}

/// Leaves modes out; those that remain are in ascending order of frequency.
///
/// # Source
/// Merging: Raghuvanshi and Lin, "Interactive sound synthesis for large scale environments" (I3D 2006).
#[must_use]
pub fn cull(voices: Vec<Voice>, culling: &Culling) -> (Vec<Voice>, DropCounts) {
    let mut counts = DropCounts::default();
    let mut rest = voices;
    counts.overdamped = dropped(&mut rest, |v| v.c < 1.999 * v.lambda.sqrt());
    counts.band = dropped(&mut rest, |v| (culling.lowest..=culling.highest).contains(&v.frequency()));
    let loudest = rest.iter().fold(0.0_f64, |m, v| m.max(v.reach));
    let floor = loudest * libm::exp10(culling.floor / 20.0);
    counts.faint = dropped(&mut rest, |v| v.reach >= floor);
    rest.sort_by(|a, b| a.lambda.total_cmp(&b.lambda));
    if culling.jnd_scale > 0.0 {
        let before = rest.len();
        rest = merge(rest, culling);
        counts.merged = before - rest.len();
    }
    if let Some(top) = culling.top.filter(|top| *top < rest.len()) {
        counts.weaker = rest.len() - top;
        let mut order: Vec<usize> = (0..rest.len()).collect();
        order.sort_by(|a, b| rest[*b].loudness().total_cmp(&rest[*a].loudness()).then(a.cmp(b)));
        order.truncate(top);
        order.sort_unstable();
        rest = order.into_iter().map(|k| rest[k].clone()).collect();
    }
    (rest, counts)
}

/// Leaves out inaudible modes, and returns their number.
fn dropped(voices: &mut Vec<Voice>, audible: impl Fn(&Voice) -> bool) -> usize {
    let before = voices.len();
    voices.retain(audible);
    before - voices.len()
}

/// Merges neighbours, from the lowest frequency up: gains add up, `lambda` and `c` are means weighted by energy.
fn merge(voices: Vec<Voice>, culling: &Culling) -> Vec<Voice> {
    let mut all: Vec<Voice> = Vec::with_capacity(voices.len());
    // Frequency at which the last cluster begins, and its latest member.
    let mut cluster: Option<(f64, Voice)> = None;
    for voice in voices {
        let f = voice.frequency();
        let joins = cluster.as_ref().is_some_and(|(start, last)| {
            f - start <= culling.jnd_scale * just_noticeable(*start)
                && !(culling.keep_beats && beats(last, &voice))
        });
        match (joins, all.last_mut()) {
            (true, Some(sum)) => {
                let energy = |v: &Voice| v.gains.iter().map(|g| g * g).sum::<f64>();
                let (a, b) = (energy(sum), energy(&voice));
                let share = if a + b > 0.0 { b / (a + b) } else { 0.5 };
                sum.lambda += share * (voice.lambda - sum.lambda);
                sum.c += share * (voice.c - sum.c);
                sum.gains.iter_mut().zip(&voice.gains).for_each(|(g, x)| *g += x);
                sum.reach += voice.reach;
                sum.members.extend(&voice.members);
                if let Some((_, last)) = &mut cluster {
                    *last = voice;
                }
            }
            _ => {
                cluster = Some((f, voice.clone()));
                all.push(voice);
            }
        }
    }
    all
}

/// Returns true if two modes are within 20 dB of each other, and beat before the shorter one has decayed by 60 dB.
fn beats(a: &Voice, b: &Voice) -> bool {
    let (x, y) = (a.loudness(), b.loudness());
    let apart = (a.frequency() - b.frequency()).abs();
    let ring = libm::log(1000.0) / a.decay().max(b.decay()).max(1e-12);
    x.min(y) > 0.1 * x.max(y) && apart * ring > 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voice(f: f64, c: f64, gain: f64) -> Voice {
        let lambda = (TAU * f).powi(2);
        Voice { lambda, c, gains: vec![gain], reach: gain.abs(), members: vec![(0, gain)] }
    }

    const ALL: Culling =
        Culling { lowest: 20.0, highest: 20e3, floor: -80.0, jnd_scale: 0.0, keep_beats: true, top: None };

    #[test]
    fn each_reason_has_its_count() {
        let voices = vec![
            voice(10.0, 1.0, 1.0),
            voice(30e3, 1.0, 1.0),
            voice(100.0, 1257.0, 1.0),
            voice(300.0, 1.0, 1.0),
            voice(500.0, 1.0, 2e-4),
            voice(600.0, 1.0, 0.9e-4),
            voice(700.0, 1.0, 0.5),
        ];
        let (rest, counts) = cull(voices, &Culling { top: Some(2), ..ALL });
        assert_eq!(counts, DropCounts { band: 2, overdamped: 1, faint: 1, merged: 0, weaker: 1 });
        let f: Vec<f64> = rest.iter().map(|v| v.frequency().round()).collect();
        assert_eq!(f, [300.0, 700.0]);
    }

    #[test]
    fn neighbours_merge_unless_they_beat() {
        assert!((just_noticeable(1000.0) - 1.95).abs() < 0.05);
        let pair = |c: f64| vec![voice(1000.0, c, 1.0), voice(1001.0, c, 1.0), voice(1010.0, c, 1.0)];
        let merging = Culling { jnd_scale: 1.0, ..ALL };
        // A beat per second is heard where modes ring for seconds.
        assert_eq!(cull(pair(2.0), &merging).1.merged, 0);
        let (rest, counts) = cull(pair(100.0), &merging);
        assert_eq!((counts.merged, rest[0].gains[0], rest.len()), (1, 2.0, 2));
        assert!((rest[0].frequency() - 1000.5).abs() < 0.2);
        let anyway = Culling { keep_beats: false, ..merging };
        assert_eq!(cull(pair(2.0), &anyway).1.merged, 1);
    }
}
