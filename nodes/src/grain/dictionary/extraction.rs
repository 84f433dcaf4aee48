//! Extraction of grains from recordings.

use super::error::GRAINS_VERSION;
use super::grain::Grain;
use super::grain_tracks::{GrainTracks, SteadyTracks, tracks_of_grains};
use super::grains::{GrainDictionary, GrainSource, Run};
use super::taper::TaperShape;
use crate::choices;
use crate::grain::recording::{Component, GrainRecording, GrainRecordings, Part};
use crate::grain::segmentation::{SegmentRules, Segments, segment};
use crate::grain::sinusoid::PeakRules;
use crate::plot::{Chart, Line};
use crate::table::ResultTable;
use foley_fft::RealFftPlanner;
use rayon::prelude::*;

choices! {
    /// Position of the tapers of a grain.
    pub enum TaperPlacement {
        /// Around the cut, over samples of the neighbour: neighbours join seamlessly.
        Outside,
        /// Within the segment, as in the paper; a join has a notch.
        Inside,
    }
}

/// Rules of an extraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractRules {
    /// Rules of the cuts.
    pub segments: SegmentRules,
    /// Share of both tapers in a grain.
    pub taper_ratio: f64,
    /// Shape of the tapers.
    pub shape: TaperShape,
    /// Position of the tapers.
    pub placement: TaperPlacement,
    /// Level below which grains are discarded: relative to the loudest grain of the recording, and of full scale, dB.
    pub discard: [f64; 2],
    /// Samples stored at both ends of a run of grains, for joins.
    pub margin: usize,
    /// Bits of the samples, each grain scaled to its own peak; 0 for 32-bit floats.
    pub bits: u16,
    /// Samples within which a cut moves to a zero crossing.
    pub snap: usize,
    /// True if the sinusoids of steady grains are stored.
    pub tracks: bool,
}

impl ExtractRules {
    /// The defaults at a rate.
    #[must_use]
    pub fn at_rate(rate: f64) -> Self {
        Self {
            segments: SegmentRules::at_rate(rate),
            taper_ratio: 0.02,
            shape: TaperShape::HalfSample,
            placement: TaperPlacement::Outside,
            discard: [-50.0, -70.0],
            margin: (0.005 * rate).round() as usize,
            bits: 16,
            snap: 0,
            tracks: false,
        }
    }
}

/// One component of a recording and its grains.
#[derive(Clone, Debug)]
pub struct Extracted {
    /// Index of the recording.
    pub recording: usize,
    /// The component.
    pub component: Component,
    /// Its cuts and its flux.
    pub segments: Segments,
    /// Grains that are not discarded, with positions in runs of this source.
    grains: Vec<Grain>,
    /// Runs as ranges of the recording.
    runs: Vec<[usize; 2]>,
    /// Number of discarded grains, and their samples.
    pub discarded: [usize; 2],
}

/// Centroid of the power spectrum of a sound, Hz.
fn centroid(x: &[f32], rate: f64) -> f32 {
    let size = x.len().next_power_of_two().max(16);
    let plan = RealFftPlanner::<f32>::new().plan_fft_forward(size);
    let (mut input, mut spectrum) = (plan.make_input_vec(), plan.make_output_vec());
    input.iter_mut().zip(x).for_each(|(y, x)| *y = *x);
    // Lengths agree by construction.
    if plan.process(&mut input, &mut spectrum).is_err() {
        return 0.0;
    }
    let (mut sum, mut moment) = (0.0, 0.0);
    for (k, x) in spectrum.iter().enumerate() {
        let power = f64::from(x.norm_sqr());
        sum += power;
        moment += power * k as f64;
    }
    if sum > 0.0 { (moment / sum * rate / size as f64) as f32 } else { 0.0 }
}

/// Numbers of samples of the tapers before and after each cut. There is no taper beyond the ends of a recording.
fn tapers_over_cuts(cuts: &[usize], rules: &ExtractRules) -> Vec<[usize; 2]> {
    let inner = |k: usize| {
        let shorter = (cuts[k] - cuts[k - 1]).min(cuts[k + 1] - cuts[k]);
        let samples = (0.5 * rules.taper_ratio * shorter as f64).round() as usize;
        [samples.div_ceil(2), samples / 2]
    };
    let last = cuts.len().saturating_sub(1);
    (0..cuts.len())
        .map(|k| {
            let is_inner = k > 0 && k < last && rules.placement == TaperPlacement::Outside;
            if is_inner { inner(k) } else { [0, 0] }
        })
        .collect()
}

/// Grains of one component.
fn grains_of(mono: &[f32], source: u32, segments: &Segments, rate: f64, rules: &ExtractRules) -> Vec<Grain> {
    let over = tapers_over_cuts(&segments.cuts, rules);
    let segment = |(k, pair): (usize, &[usize])| {
        let len = pair[1] - pair[0];
        let inside = (0.5 * rules.taper_ratio * len as f64).round() as usize;
        let taper = |cut: [usize; 2]| if cut == [0, 0] { inside } else { cut[0] + cut[1] };
        let (reach, tapers) = ([over[k][0], over[k + 1][1]], [taper(over[k]), taper(over[k + 1])]);
        let span = pair[0] - reach[0]..pair[1] + reach[1];
        let window = rules.shape.window(span.len(), tapers);
        let windowed: Vec<f32> =
            mono[span.clone()].iter().zip(window).map(|(x, w)| (f64::from(*x) * w) as f32).collect();
        let (power, before) = (mean_square(&windowed), mean_square(&mono[span.clone()]));
        let is_scaled = rules.placement == TaperPlacement::Inside && power > 0.0;
        let gain = if is_scaled { (before / power).sqrt() } else { 1.0 };
        Grain {
            gain,
            source,
            start: pair[0] as u64,
            len: len as u32,
            reach: reach.map(|x| x as u16),
            taper: tapers.map(|x| x as u16),
            power: gain * gain * power,
            centroid: centroid(&windowed, rate),
            run: 0,
            position: 0,
        }
    };
    segments.cuts.windows(2).enumerate().map(segment).collect()
}

/// Moves each inner cut to the nearest zero crossing within `reach` samples, the earlier of two; cuts remain in order.
fn snap_to_zero_crossings(x: &[f32], cuts: &mut [usize], reach: usize) {
    let crosses = |t: usize| t > 0 && t < x.len() && (x[t - 1] < 0.0) != (x[t] < 0.0);
    for k in 1..cuts.len().saturating_sub(1) {
        let cut = cuts[k];
        let is_between = |t: &usize| *t > cuts[k - 1] && *t < cuts[k + 1];
        let near = (0..=reach).flat_map(|d| [cut.checked_sub(d), cut.checked_add(d)]).flatten();
        if let Some(t) = near.filter(is_between).find(|t| crosses(*t)) {
            cuts[k] = t;
        }
    }
}

/// Cuts and grains of one component of a recording.
fn extract_part(recording: usize, part: &Part, source: u32, rate: f64, rules: &ExtractRules) -> Extracted {
    let mono = part.mono();
    let mut segments = segment(&mono, &rules.segments);
    snap_to_zero_crossings(&mono, &mut segments.cuts, rules.snap);
    let all = grains_of(&mono, source, &segments, rate, rules);
    let loudest = all.iter().map(|g| f64::from(g.power)).fold(0.0, f64::max);
    let limit = (loudest * 10f64.powf(rules.discard[0] / 10.0)).max(10f64.powf(rules.discard[1] / 10.0));
    let (mut grains, mut runs): (Vec<Grain>, Vec<[usize; 2]>) = (Vec::new(), Vec::new());
    let mut discarded = [0, 0];
    for grain in all {
        let power = f64::from(grain.power);
        if power < limit || power <= 0.0 {
            discarded = [discarded[0] + 1, discarded[1] + grain.len as usize];
            continue;
        }
        let (start, end) = (grain.start as usize, grain.start as usize + grain.len as usize);
        let begins = start.saturating_sub(rules.margin.max(grain.reach[0].into()));
        let ends = (end + rules.margin.max(grain.reach[1].into())).min(mono.len());
        match runs.last_mut().filter(|run| run[1] >= begins) {
            Some(run) => run[1] = run[1].max(ends),
            None => runs.push([begins, ends]),
        }
        let run = runs.len() - 1;
        let position = (start - runs[run][0]) as u32;
        grains.push(Grain { run: run as u32, position, ..grain });
    }
    Extracted { recording, component: part.component, segments, grains, runs, discarded }
}

/// Adds the samples of a range of a part to the dictionary.
fn add_run(samples: &mut Vec<f32>, runs: &mut Vec<Run>, part: &Part, range: [usize; 2]) {
    let offset = samples.len() as u64;
    for channel in &part.channels {
        samples.extend(channel.get(range[0]..range[1]).unwrap_or_default());
    }
    runs.push(Run { offset, frames: (range[1] - range[0]) as u32, channels: part.channels.len() as u16 });
}

/// Extracts the grains of recordings: cuts, tapers, levels. Grains below the levels of `discard` are left out.
///
/// # Complexity
/// One transform a hop and one for each grain, on all cores.
///
/// # Source
/// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 3.3.
#[must_use]
pub fn extract(recordings: &GrainRecordings, rules: &ExtractRules) -> (GrainDictionary, Vec<Extracted>) {
    let parts: Vec<(usize, &GrainRecording, &Part)> = recordings
        .recordings
        .iter()
        .enumerate()
        .flat_map(|(k, recording)| recording.parts.iter().map(move |part| (k, recording, part)))
        .collect();
    let extracted: Vec<Extracted> = parts
        .par_iter()
        .enumerate()
        .map(|(source, (k, _, part))| extract_part(*k, part, source as u32, recordings.rate, rules))
        .collect();
    let (mut samples, mut runs, mut grains) = (Vec::new(), Vec::new(), Vec::new());
    for (found, (_, _, part)) in extracted.iter().zip(&parts) {
        let first = runs.len() as u32;
        found.runs.iter().for_each(|range| add_run(&mut samples, &mut runs, part, *range));
        grains.extend(found.grains.iter().map(|grain| Grain { run: first + grain.run, ..*grain }));
    }
    let source = |(_, recording, part): &(usize, &GrainRecording, &Part)| GrainSource {
        name: recording.name.clone(),
        licence: recording.licence.clone(),
        tags: recording.tags.clone(),
        kind: recording.kind,
        component: part.component,
        speed: recording.speed,
        content: recording.content.clone(),
        frames: recording.len() as u64,
    };
    let mut dictionary = GrainDictionary {
        version: GRAINS_VERSION,
        rate: recordings.rate,
        symmetric_tapers: rules.shape == TaperShape::Symmetric,
        bits: 0,
        sources: parts.iter().map(source).collect(),
        grains,
        runs,
        steps: Vec::new(),
        samples,
        tracks: None,
    };
    dictionary.tracks =
        rules.tracks.then(|| steady_tracks(&parts, &extracted, recordings.rate, rules.margin));
    if rules.bits > 0 {
        dictionary.quantise(rules.bits);
        let powers: Vec<f32> =
            dictionary.grains.iter().map(|g| mean_square(&dictionary.windowed(g))).collect();
        dictionary.grains.iter_mut().zip(powers).for_each(|(grain, power)| grain.power = power);
    }
    (dictionary, extracted)
}

/// The sinusoids of the steady grains of all parts; other grains have none.
fn steady_tracks(
    parts: &[(usize, &GrainRecording, &Part)],
    extracted: &[Extracted],
    rate: f64,
    margin: usize,
) -> SteadyTracks {
    let of_part = |((_, _, part), found): (&(usize, &GrainRecording, &Part), &Extracted)| match part.component
    {
        Component::Steady => tracks_of_grains(&part.channels, &found.grains, margin, rate),
        _ => vec![GrainTracks::default(); found.grains.len()],
    };
    let grains: Vec<Vec<GrainTracks>> = parts.par_iter().zip(extracted).map(of_part).collect();
    SteadyTracks { hop: PeakRules::at_rate(rate).hop as u32, grains: grains.concat() }
}

/// Mean square of a sound.
#[must_use]
pub fn mean_square(x: &[f32]) -> f32 {
    let sum: f64 = x.iter().map(|x| f64::from(*x).powi(2)).sum();
    (sum / x.len().max(1) as f64) as f32
}

/// Recordings whose flux is drawn.
const DRAWN: usize = 6;

/// A row for each component of a recording, with its flux and its cuts as charts.
#[must_use]
pub fn extraction_table(
    recordings: &GrainRecordings,
    extracted: &[Extracted],
    rules: &ExtractRules,
) -> ResultTable {
    let mut table = ResultTable::new(&[
        "recording",
        "component",
        "kind",
        "seconds",
        "grains",
        "cuts_per_second",
        "onsets",
        "discarded",
        "discarded_bytes",
    ]);
    for found in extracted {
        let Some(recording) = recordings.recordings.get(found.recording) else { continue };
        let seconds = recording.len() as f64 / recordings.rate;
        let cuts = found.segments.cuts.len().saturating_sub(2);
        table.push([
            recording.name.as_str().into(),
            format!("{:?}", found.component).to_lowercase().into(),
            format!("{:?}", recording.kind).to_lowercase().into(),
            seconds.into(),
            found.grains.len().into(),
            (cuts as f64 / seconds.max(1e-9)).into(),
            found.segments.onsets.len().into(),
            found.discarded[0].into(),
            (2 * found.discarded[1]).into(),
        ]);
        if table.charts.len() < DRAWN {
            table.charts.push(flux_chart(&recording.name, found, recordings.rate, rules));
        }
    }
    table
}

/// A row for each onset and each cut of each component of a recording.
#[must_use]
pub fn times_table(recordings: &GrainRecordings, extracted: &[Extracted]) -> ResultTable {
    let mut table = ResultTable::new(&["recording", "component", "what", "time_s"]);
    for found in extracted {
        let Some(recording) = recordings.recordings.get(found.recording) else { continue };
        let component = format!("{:?}", found.component).to_lowercase();
        for (what, samples) in [("onset", &found.segments.onsets), ("cut", &found.segments.cuts)] {
            for sample in samples {
                let time = *sample as f64 / recordings.rate;
                table.push([
                    recording.name.as_str().into(),
                    component.as_str().into(),
                    what.into(),
                    time.into(),
                ]);
            }
        }
    }
    table
}

/// Flux of a recording over time, with its cuts and its onsets.
fn flux_chart(name: &str, found: &Extracted, rate: f64, rules: &ExtractRules) -> Chart {
    let hop = rules.segments.frames.hop as f64;
    let at = |k: usize| (k as f64 - 0.5) * hop / rate;
    let line = |x: &[f64]| x.iter().enumerate().map(|(k, y)| [at(k), *y]).collect();
    let smooth = &found.segments.smooth;
    let on_line = |samples: &[usize]| -> Vec<[f64; 2]> {
        let value = |t: usize| smooth.get((t as f64 / hop + 0.5).round() as usize).copied().unwrap_or(0.0);
        samples.iter().map(|t| [*t as f64 / rate, value(*t)]).collect()
    };
    let file = name.rsplit('/').next().unwrap_or(name);
    let title = match found.component {
        Component::Whole => file.to_owned(),
        component => format!("{file}, {}", format!("{component:?}").to_lowercase()),
    };
    let lines = vec![
        Line::new("spectral flux", line(&found.segments.flux)),
        Line::new("smoothed", line(smooth)),
        Line::dots("cuts", on_line(&found.segments.cuts)),
        Line::dots("onsets", on_line(&found.segments.onsets)),
    ];
    Chart::of(title, ("time, s", false), ("flux", false), lines)
}

#[cfg(test)]
mod tests;
