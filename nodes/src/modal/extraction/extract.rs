//! Modes from a recording of one impact.

use crate::modal::mode::modes::{MODES_VERSION, Modes};
use realfft::RealFftPlanner;
use std::f64::consts::{LN_10, PI, TAU};
use thiserror::Error;

/// Limits of the search for modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractParams {
    /// Maximum number of modes.
    pub modes: usize,
    /// Level below the highest peak, in dB, from which on peaks are no modes.
    pub range: f64,
    /// Lowest frequency, in Hz.
    pub lowest: f64,
    /// Highest frequency, in Hz; at most 0.45 of the rate.
    pub highest: f64,
    /// Number of times that all modes are fitted again, each on the residual of the others.
    pub passes: usize,
}

impl Default for ExtractParams {
    fn default() -> Self {
        Self { modes: 64, range: 60.0, lowest: 30.0, highest: 18_000.0, passes: 3 }
    }
}

/// Error of [`extract`].
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// A sample that is not a number.
    #[error("sample {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// All samples are 0.
    #[error("the recording is silent")]
    Silent,
    /// Too few samples after the impact.
    #[error("{found} samples follow the impact; at least {MIN_SAMPLES} are needed")]
    Short {
        /// Samples found.
        found: usize,
    },
    /// No decaying sine was found.
    #[error("nothing in the recording rings and decays")]
    Nothing,
}

/// Minimum number of samples after the impact.
const MIN_SAMPLES: usize = 1024;

/// One damped sine from the onset: `amplitude exp(-damping t) sin(2 pi frequency t + phase)`.
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

/// The modes of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Extracted {
    /// The modes, in order of frequency.
    pub partials: Vec<Partial>,
    /// Index of the first sample of the impact.
    pub onset: usize,
    /// Energy of the residual, in dB relative to the recording.
    pub residual_db: f64,
}

impl Extracted {
    /// Converts to modes with one contact point, so that an impact of `impulse` N s sounds like the recording.
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

/// Index of the first sample of the impact.
///
/// It lies in the first millisecond of the run that ends with the loudest one, in which each has a hundredth of its power.
#[must_use]
pub fn onset(samples: &[f32], rate: f64) -> usize {
    let hop = ((rate / 1000.0) as usize).max(1);
    let power = |frame: &[f32]| frame.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let powers: Vec<f64> = samples.chunks(hop).map(power).collect();
    let (mut first, max) =
        powers.iter().copied().enumerate().fold((0, 0.0), |best, p| if p.1 > best.1 { p } else { best });
    while first > 0 && powers[first - 1] > 0.01 * max {
        first -= 1;
    }
    // Within that millisecond, the first sample above a tenth of its peak.
    let frame = samples.get(first * hop..).unwrap_or_default();
    let frame = &frame[..hop.min(frame.len())];
    let peak = frame.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    first * hop + frame.iter().position(|x| x.abs() > 0.1 * peak).unwrap_or(0).saturating_sub(1)
}

/// Extracts the modes from a recording of one impact.
///
/// The highest peak of the spectrum is fitted as a damped sine and subtracted, then the next one, while there are peaks. Then each
/// mode is fitted again, `passes` times, on the residual of all the others. A fit demodulates the mode to 0 Hz, smooths it by
/// Blackman-Harris windows, and fits straight lines to its log magnitude and its phase, over the first 30 dB of its decay and
/// above the noise. Windows are longer for smaller dampings. Amplitude and phase minimise the energy of the residual, so that it
/// never grows.
///
/// # Errors
/// A recording that is silent, too short, not finite, or without a decaying sine.
///
/// # Complexity
/// O(passes modes samples), and one Fourier transform of the recording per mode.
///
/// # Source
/// Picard, Tsingos and Faure (VRIPHYS 2008) take modes from recordings of impulse responses and give no method. The repeated fits
/// are RELAX: Li and Stoica, "Efficient mixed-spectrum estimation" (IEEE TSP 44(2), 1996).
pub fn extract(samples: &[f32], rate: f64, params: &ExtractParams) -> Result<Extracted, ExtractError> {
    if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
        return Err(ExtractError::NotFinite { index });
    }
    if samples.iter().all(|x| *x == 0.0) {
        return Err(ExtractError::Silent);
    }
    let onset = onset(samples, rate);
    let sound: Vec<f64> = samples[onset..].iter().map(|x| f64::from(*x)).collect();
    if sound.len() < MIN_SAMPLES {
        return Err(ExtractError::Short { found: sound.len() });
    }
    let mut residual = sound.clone();
    let mut partials = search(&mut residual, rate, params);
    for _ in 0..params.passes {
        for partial in &mut partials {
            add(&mut residual, rate, partial, 1.0);
            // A new amplitude at the old frequency and damping, or a new fit if that removes more energy.
            let old = project(&residual, rate, partial.frequency, partial.damping);
            let new = fit(&residual, rate, partial.frequency, partial.damping);
            let better = old.into_iter().chain(new).max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((better, _)) = better {
                *partial = better;
            }
            add(&mut residual, rate, partial, -1.0);
        }
    }
    // A fit may drift to a constant, which rings nothing and would hide the modes by its gain.
    let (inside, outside): (Vec<_>, Vec<_>) =
        partials.into_iter().partition(|p| p.frequency >= params.lowest);
    let mut partials = inside;
    outside.iter().for_each(|partial| add(&mut residual, rate, partial, 1.0));
    let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    partials.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    if partials.is_empty() {
        return Err(ExtractError::Nothing);
    }
    let residual_db = 10.0 * (energy(&residual) / energy(&sound)).max(1e-30).log10();
    Ok(Extracted { partials, onset, residual_db })
}

/// Adds `sign` times a partial to the residual.
fn add(residual: &mut [f64], rate: f64, p: &Partial, sign: f64) {
    let (radius, w) = (libm::exp(-p.damping / rate), TAU * p.frequency / rate);
    let (c, s) = (radius * libm::cos(w), radius * libm::sin(w));
    let a = sign * p.amplitude;
    let (mut re, mut im) = (a * libm::cos(p.phase), a * libm::sin(p.phase));
    for x in residual {
        *x += im;
        (re, im) = (c * re - s * im, s * re + c * im);
    }
}

/// Subtracts the modes of the spectral peaks, from the highest down.
fn search(residual: &mut [f64], rate: f64, params: &ExtractParams) -> Vec<Partial> {
    let n = (2 * residual.len()).next_power_of_two();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let (mut time, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
    let bin = rate / n as f64;
    let bins = |f: f64| ((f / bin) as usize).min(n / 2);
    let (low, high) = (bins(params.lowest).max(1), bins(params.highest.min(0.45 * rate)));
    // Peaks that are no modes, or whose modes are found.
    let mut blocked = vec![false; n / 2 + 1];
    let block = |blocked: &mut Vec<bool>, f: f64, width: f64| {
        let (a, b) = (bins((f - width).max(0.0)), bins(f + width));
        blocked[a..=b].fill(true);
    };
    let resolution = rate / residual.len() as f64;
    let mut partials: Vec<Partial> = Vec::new();
    let mut first = None;
    for _ in 0..2 * params.modes {
        if partials.len() == params.modes {
            break;
        }
        time.fill(0.0);
        time[..residual.len()].copy_from_slice(residual);
        if plan.process(&mut time, &mut spectrum).is_err() {
            break;
        }
        let power: Vec<f64> = spectrum.iter().map(|z| z.norm_sqr()).collect();
        let peaks =
            (low..high).filter(|k| !blocked[*k] && power[*k] >= power[k - 1] && power[*k] >= power[k + 1]);
        let Some(peak) = peaks.max_by(|a, b| power[*a].total_cmp(&power[*b])) else { break };
        let highest = *first.get_or_insert(power[peak]);
        if power[peak] <= highest * 10.0_f64.powf(-0.1 * params.range) {
            break;
        }
        let frequency = peak as f64 * bin;
        // The half-power width of a damped sine's peak is d / pi.
        let half_width = |step: isize| {
            let mut k = peak as isize;
            while k > 1 && (k as usize) < n / 2 && power[k as usize] > 0.5 * power[peak] {
                k += step;
            }
            (k - peak as isize).unsigned_abs()
        };
        let width = (half_width(1) + half_width(-1)) as f64 * bin;
        match fit(residual, rate, frequency, PI * width) {
            Some((partial, _)) if (partial.frequency - frequency).abs() < 2.0 * width.max(resolution) => {
                add(residual, rate, &partial, -1.0);
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

/// Fits a damped sine near a frequency; `None` if nothing decays there. Returns it with the energy that it removes.
fn fit(residual: &[f64], rate: f64, frequency: f64, damping: f64) -> Option<(Partial, f64)> {
    // The time of a decay by about 20 dB, within limits that resolve close modes.
    let length = (2.5 * rate / damping.max(1.0)) as usize;
    let length = length.clamp(256, 16_384).min(residual.len() / 2);
    let hop = (length / 8).max(1);
    let frames = (residual.len() - length) / hop + 1;
    let window = window(length);
    let w = TAU * frequency / rate;
    let demodulated = |at: usize| {
        let (mut re, mut im) = (0.0, 0.0);
        let (c, s) = (libm::cos(w), libm::sin(w));
        let (mut a, mut b) = (libm::cos(w * at as f64), -libm::sin(w * at as f64));
        for (x, h) in residual[at..at + length].iter().zip(&window) {
            re += x * h * a;
            im += x * h * b;
            (a, b) = (c * a + s * b, c * b - s * a);
        }
        (re, im)
    };
    let envelope: Vec<(f64, f64)> = (0..frames).map(|k| demodulated(k * hop)).collect();
    let magnitude: Vec<f64> = envelope.iter().map(|(re, im)| re.hypot(*im)).collect();
    let used = decay_frames(&magnitude);
    if used < 3 {
        return None;
    }
    let mut lines = Lines::default();
    let (mut phase, mut last) = (0.0, 0.0);
    for k in 0..used {
        let angle = libm::atan2(envelope[k].1, envelope[k].0);
        phase = if k == 0 { angle } else { phase + (angle - last + PI).rem_euclid(TAU) - PI };
        last = angle;
        lines.add(k as f64 * hop as f64 / rate, magnitude[k].ln(), phase, magnitude[k] * magnitude[k]);
    }
    let (slope, phase_slope) = lines.slopes()?;
    let (d, f) = (-slope, frequency + phase_slope / TAU);
    // A decay by less than 4 dB over the recording is hum.
    let plausible = d > 0.5 * rate / residual.len() as f64 && d < 0.5 * rate && f > 0.0 && f < 0.5 * rate;
    if !plausible {
        return None;
    }
    project(residual, rate, f, d)
}

/// Projects the residual on the damped sines of a frequency and damping. Returns the projection and its energy.
fn project(residual: &[f64], rate: f64, frequency: f64, damping: f64) -> Option<(Partial, f64)> {
    let (radius, w) = (libm::exp(-damping / rate), TAU * frequency / rate);
    let (c, s) = (radius * libm::cos(w), radius * libm::sin(w));
    let (mut cos, mut sin) = (1.0, 0.0);
    let (mut cc, mut ss, mut cs, mut xc, mut xs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for x in residual {
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
    let removed = of_sin * xs + of_cos * xc;
    (removed.is_finite() && removed > 0.0).then_some((partial, removed))
}

/// Number of frames from the first with the first 30 dB of the decay, above the noise.
fn decay_frames(magnitude: &[f64]) -> usize {
    let max = magnitude.iter().copied().fold(0.0, f64::max);
    let mut tail = magnitude[magnitude.len() - magnitude.len() / 4..].to_vec();
    tail.sort_by(f64::total_cmp);
    let noise = tail.get(tail.len() / 2).copied().unwrap_or(0.0);
    // A tail within 20 dB of the maximum is the mode itself, not noise.
    let noise = if noise < 0.1 * max { 3.0 * noise } else { 0.0 };
    let min = (max * (-1.5 * LN_10).exp()).max(noise);
    magnitude.iter().position(|x| *x <= min).unwrap_or(magnitude.len())
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

    /// Slopes of both lines.
    fn slopes(&self) -> Option<(f64, f64)> {
        let det = self.w * self.tt - self.t * self.t;
        let slope = |(y, ty): (f64, f64)| (ty * self.w - y * self.t) / det;
        let (a, b) = (slope(self.a), slope(self.b));
        (det > 0.0 && a.is_finite() && b.is_finite()).then_some((a, b))
    }
}

#[cfg(test)]
mod tests;
