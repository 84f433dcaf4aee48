//! Modes from a recording of one blow.

use crate::modal::mode::modes::{MODES_VERSION, Modes};
use realfft::RealFftPlanner;
use std::f64::consts::{LN_10, PI, TAU};
use thiserror::Error;

/// What to look for in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractParams {
    /// Most modes that are taken.
    pub modes: usize,
    /// Peaks this many dB below the highest are no modes.
    pub range: f64,
    /// Lowest frequency looked at, in Hz.
    pub lowest: f64,
    /// Highest frequency looked at, in Hz; never above 0.45 of the rate.
    pub highest: f64,
    /// How often all modes are fitted anew, each on what the others leave.
    pub passes: usize,
}

impl Default for ExtractParams {
    fn default() -> Self {
        Self { modes: 64, range: 60.0, lowest: 30.0, highest: 18_000.0, passes: 3 }
    }
}

/// Why no modes were found.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// A sample that is not a number.
    #[error("sample {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// Nothing to hear.
    #[error("the recording is silent")]
    Silent,
    /// Too little after the blow.
    #[error("{found} samples follow the blow; at least {LEAST} are needed")]
    Short {
        /// Samples found.
        found: usize,
    },
    /// Nothing rings.
    #[error("nothing in the recording rings and decays")]
    Nothing,
}

/// Fewest samples after the blow.
const LEAST: usize = 1024;

/// One damped sine, from the onset on: `amplitude exp(-damping t) sin(2 pi frequency t + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partial {
    /// In Hz.
    pub frequency: f64,
    /// In 1/s.
    pub damping: f64,
    /// Of full scale.
    pub amplitude: f64,
    /// In radians.
    pub phase: f64,
}

/// What a recording holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Extracted {
    /// The modes, by frequency.
    pub partials: Vec<Partial>,
    /// Sample at which the blow falls.
    pub onset: usize,
    /// Energy that the modes leave unexplained, in dB of the whole.
    pub residual_db: f64,
}

impl Extracted {
    /// The modes as a blow of `impulse` N s at one contact point makes them ring.
    #[must_use]
    pub fn modes(&self, name: &str, impulse: f64, phases: bool) -> Modes {
        let all = &self.partials;
        Modes {
            version: MODES_VERSION,
            name: name.to_owned(),
            frequencies: all.iter().map(|p| p.frequency).collect(),
            dampings: all.iter().map(|p| p.damping).collect(),
            gains: all.iter().map(|p| (p.amplitude / impulse) as f32).collect(),
            phases: if phases { all.iter().map(|p| p.phase as f32).collect() } else { Vec::new() },
        }
    }
}

/// Where the blow falls: the first millisecond with a hundredth of the power of the loudest, in a run that leads up to it.
#[must_use]
pub fn onset(samples: &[f32], rate: f64) -> usize {
    let hop = ((rate / 1000.0) as usize).max(1);
    let power = |frame: &[f32]| frame.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let powers: Vec<f64> = samples.chunks(hop).map(power).collect();
    let (mut at, most) =
        powers.iter().copied().enumerate().fold((0, 0.0), |best, p| if p.1 > best.1 { p } else { best });
    while at > 0 && powers[at - 1] > 0.01 * most {
        at -= 1;
    }
    // Within that millisecond, the first sample that is not small.
    let frame = samples.get(at * hop..).unwrap_or_default();
    let frame = &frame[..hop.min(frame.len())];
    let peak = frame.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    at * hop + frame.iter().position(|x| x.abs() > 0.1 * peak).unwrap_or(0).saturating_sub(1)
}

/// Finds the modes that ring after the one blow in a recording.
///
/// The highest peak of the spectrum is fitted as a damped sine and taken away; then the next, as long as there are peaks. After
/// that each mode is fitted again, several times, on the recording without all the others. A fit moves the mode to 0 Hz, smooths it by
/// Blackman-Harris windows and lays straight lines through the logarithm of its magnitude and through its phase, over the
/// first 30 dB of its decay and above the noise; windows are long for modes that ring long. Amplitude and phase are those that take
/// most energy away, so that what is left only falls.
///
/// # Errors
/// When the recording is silent, too short, not finite or nothing rings in it.
///
/// # Complexity
/// O(passes modes samples) and one transform of the recording per mode.
///
/// # Source
/// Picard, Tsingos and Faure (VRIPHYS 2008) take modes from recordings of impulse responses and give no method. Fitting each on what
/// the others leave is RELAX: Li and Stoica, "Efficient mixed-spectrum estimation" (IEEE TSP 44(2), 1996).
pub fn extract(samples: &[f32], rate: f64, params: &ExtractParams) -> Result<Extracted, ExtractError> {
    if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
        return Err(ExtractError::NotFinite { index });
    }
    if samples.iter().all(|x| *x == 0.0) {
        return Err(ExtractError::Silent);
    }
    let onset = onset(samples, rate);
    let sound: Vec<f64> = samples[onset..].iter().map(|x| f64::from(*x)).collect();
    if sound.len() < LEAST {
        return Err(ExtractError::Short { found: sound.len() });
    }
    let mut rest = sound.clone();
    let mut partials = search(&mut rest, rate, params);
    for _ in 0..params.passes {
        for partial in &mut partials {
            add(&mut rest, rate, partial, 1.0);
            // The old frequency and damping with a new amplitude, unless new ones explain more.
            let old = project(&rest, rate, partial.frequency, partial.damping);
            let new = fit(&rest, rate, partial.frequency, partial.damping);
            let better = old.into_iter().chain(new).max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((better, _)) = better {
                *partial = better;
            }
            add(&mut rest, rate, partial, -1.0);
        }
    }
    let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    partials.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    if partials.is_empty() {
        return Err(ExtractError::Nothing);
    }
    let residual_db = 10.0 * (energy(&rest) / energy(&sound)).max(1e-30).log10();
    Ok(Extracted { partials, onset, residual_db })
}

/// Adds `sign` times a partial.
fn add(rest: &mut [f64], rate: f64, p: &Partial, sign: f64) {
    let (radius, w) = (libm::exp(-p.damping / rate), TAU * p.frequency / rate);
    let (c, s) = (radius * libm::cos(w), radius * libm::sin(w));
    let a = sign * p.amplitude;
    let (mut re, mut im) = (a * libm::cos(p.phase), a * libm::sin(p.phase));
    for x in rest {
        *x += im;
        (re, im) = (c * re - s * im, s * re + c * im);
    }
}

/// Takes peaks from the spectrum, the highest first.
fn search(rest: &mut [f64], rate: f64, params: &ExtractParams) -> Vec<Partial> {
    let n = (2 * rest.len()).next_power_of_two();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let (mut time, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
    let bin = rate / n as f64;
    let bins = |f: f64| ((f / bin) as usize).min(n / 2);
    let (low, high) = (bins(params.lowest).max(1), bins(params.highest.min(0.45 * rate)));
    // Peaks that turned out to be no modes, or whose modes are taken already.
    let mut blocked = vec![false; n / 2 + 1];
    let block = |blocked: &mut Vec<bool>, f: f64, width: f64| {
        let (a, b) = (bins((f - width).max(0.0)), bins(f + width));
        blocked[a..=b].fill(true);
    };
    let resolution = rate / rest.len() as f64;
    let mut partials: Vec<Partial> = Vec::new();
    let mut first = None;
    for _ in 0..2 * params.modes {
        if partials.len() == params.modes {
            break;
        }
        time.fill(0.0);
        time[..rest.len()].copy_from_slice(rest);
        if plan.process(&mut time, &mut spectrum).is_err() {
            break;
        }
        let size: Vec<f64> = spectrum.iter().map(|z| z.norm_sqr()).collect();
        let open = (low..high).filter(|k| !blocked[*k] && size[*k] >= size[k - 1] && size[*k] >= size[k + 1]);
        let Some(peak) = open.max_by(|a, b| size[*a].total_cmp(&size[*b])) else { break };
        let top = *first.get_or_insert(size[peak]);
        if size[peak] <= top * 10.0_f64.powf(-0.1 * params.range) {
            break;
        }
        let frequency = peak as f64 * bin;
        // A damped sine's peak is d / pi wide where it has half its power.
        let wide = |step: isize| {
            let mut k = peak as isize;
            while k > 1 && (k as usize) < n / 2 && size[k as usize] > 0.5 * size[peak] {
                k += step;
            }
            (k - peak as isize).unsigned_abs()
        };
        let width = (wide(1) + wide(-1)) as f64 * bin;
        match fit(rest, rate, frequency, PI * width) {
            Some((partial, _)) if (partial.frequency - frequency).abs() < 2.0 * width.max(resolution) => {
                add(rest, rate, &partial, -1.0);
                block(&mut blocked, partial.frequency, (0.5 * resolution).max(partial.damping / TAU));
                partials.push(partial);
            }
            _ => block(&mut blocked, frequency, resolution.max(0.5 * width)),
        }
    }
    partials
}

/// Blackman-Harris window, four terms.
fn window(length: usize) -> Vec<f64> {
    const A: [f64; 4] = [0.358_75, 0.488_29, 0.141_28, 0.011_68];
    let at = |n: usize| {
        let x = TAU * (n as f64 + 0.5) / length as f64;
        A[0] - A[1] * libm::cos(x) + A[2] * libm::cos(2.0 * x) - A[3] * libm::cos(3.0 * x)
    };
    (0..length).map(at).collect()
}

/// Fits a damped sine near a frequency; `None` where nothing decays there.
fn fit(rest: &[f64], rate: f64, frequency: f64, damping: f64) -> Option<(Partial, f64)> {
    // As long as the mode falls by some 20 dB, and long enough to tell its neighbours apart.
    let length = (2.5 * rate / damping.max(1.0)) as usize;
    let length = length.clamp(256, 16_384).min(rest.len() / 2);
    let hop = (length / 8).max(1);
    let frames = (rest.len() - length) / hop + 1;
    let window = window(length);
    let w = TAU * frequency / rate;
    let turned = |at: usize| {
        let (mut re, mut im) = (0.0, 0.0);
        let (c, s) = (libm::cos(w), libm::sin(w));
        let (mut a, mut b) = (libm::cos(w * at as f64), -libm::sin(w * at as f64));
        for (x, h) in rest[at..at + length].iter().zip(&window) {
            re += x * h * a;
            im += x * h * b;
            (a, b) = (c * a + s * b, c * b - s * a);
        }
        (re, im)
    };
    let envelope: Vec<(f64, f64)> = (0..frames).map(|k| turned(k * hop)).collect();
    let size: Vec<f64> = envelope.iter().map(|(re, im)| re.hypot(*im)).collect();
    let used = usable(&size);
    if used < 3 {
        return None;
    }
    let mut lines = Lines::default();
    let (mut phase, mut last) = (0.0, 0.0);
    for k in 0..used {
        let angle = libm::atan2(envelope[k].1, envelope[k].0);
        phase = if k == 0 { angle } else { phase + (angle - last + PI).rem_euclid(TAU) - PI };
        last = angle;
        lines.add(k as f64 * hop as f64 / rate, size[k].ln(), phase, size[k] * size[k]);
    }
    let (slope, turn) = lines.slopes()?;
    let (d, f) = (-slope, frequency + turn / TAU);
    // What falls by less than 4 dB in the whole recording is hum.
    let plausible = d > 0.5 * rate / rest.len() as f64 && d < 0.5 * rate && f > 0.0 && f < 0.5 * rate;
    if !plausible {
        return None;
    }
    project(rest, rate, f, d)
}

/// The damped sine of this frequency and damping that takes most energy away, and how much that is.
fn project(rest: &[f64], rate: f64, frequency: f64, damping: f64) -> Option<(Partial, f64)> {
    let (radius, w) = (libm::exp(-damping / rate), TAU * frequency / rate);
    let (c, s) = (radius * libm::cos(w), radius * libm::sin(w));
    let (mut cos, mut sin) = (1.0, 0.0);
    let (mut cc, mut ss, mut cs, mut xc, mut xs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for x in rest {
        cc += cos * cos;
        ss += sin * sin;
        cs += cos * sin;
        xc += x * cos;
        xs += x * sin;
        (cos, sin) = (c * cos - s * sin, s * cos + c * sin);
    }
    let det = cc * ss - cs * cs;
    let (of_sin, of_cos) = ((xs * cc - xc * cs) / det, (xc * ss - xs * cs) / det);
    let partial =
        Partial { frequency, damping, amplitude: of_sin.hypot(of_cos), phase: libm::atan2(of_cos, of_sin) };
    let taken = of_sin * xs + of_cos * xc;
    (taken.is_finite() && taken > 0.0).then_some((partial, taken))
}

/// How many frames from the first on hold the decay: 30 dB of it, and above the noise.
fn usable(size: &[f64]) -> usize {
    let most = size.iter().copied().fold(0.0, f64::max);
    let mut tail = size[size.len() - size.len() / 4..].to_vec();
    tail.sort_by(f64::total_cmp);
    let noise = tail.get(tail.len() / 2).copied().unwrap_or(0.0);
    // A tail that is still loud is no noise, but the mode itself.
    let noise = if noise < 0.1 * most { 3.0 * noise } else { 0.0 };
    let least = (most * (-1.5 * LN_10).exp()).max(noise);
    size.iter().position(|x| *x <= least).unwrap_or(size.len())
}

/// Two straight lines over time by weighted least squares.
#[derive(Default)]
struct Lines {
    w: f64,
    t: f64,
    tt: f64,
    a: (f64, f64),
    b: (f64, f64),
}

impl Lines {
    fn add(&mut self, t: f64, a: f64, b: f64, w: f64) {
        self.w += w;
        self.t += w * t;
        self.tt += w * t * t;
        self.a = (self.a.0 + w * a, self.a.1 + w * a * t);
        self.b = (self.b.0 + w * b, self.b.1 + w * b * t);
    }

    /// Slope of each.
    fn slopes(&self) -> Option<(f64, f64)> {
        let det = self.w * self.tt - self.t * self.t;
        let slope = |(y, ty): (f64, f64)| (ty * self.w - y * self.t) / det;
        let (a, b) = (slope(self.a), slope(self.b));
        (det > 0.0 && a.is_finite() && b.is_finite()).then_some((a, b))
    }
}

#[cfg(test)]
mod tests;
