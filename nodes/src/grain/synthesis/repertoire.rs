//! Sounds that a dictionary provides for impacts and for contact that lasts.

use super::segment::{GrainSegment, GrainStep, segments};
use super::walk::{GapRule, VariationRules, varied, walk};
use crate::core::random::Random;
use crate::grain::correlation::{CorrelationPatterns, Pattern};
use crate::grain::dictionary::{GrainDictionary, GrainSource};
use crate::grain::recording::{Component, SourceKind, matching_tags};

/// The sound of an impact, in order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct ImpactSound {
    /// Segments, with gains that give all sounds of the tags their common energy.
    pub segments: Vec<GrainSegment>,
    /// Frames from the beginning of the first segment to the end of the last.
    pub frames: i64,
}

/// Grains of a recording in order of time, to be chained.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSound {
    /// The component.
    pub component: Component,
    /// Speed of the recorded motion, m/s, if it is known.
    pub speed: Option<f64>,
    /// The grains; gains level them to the median power of the component over all sounds of the tags.
    pub steps: Vec<GrainStep>,
}

/// Rules for the use of a dictionary.
#[derive(Clone, Copy, Debug)]
pub struct RepertoireRules {
    /// Number of variations of each impact; 1 for the recording itself.
    pub variations: usize,
    /// Share of the differences of level between grains, and between impacts, that remains.
    pub spread: f64,
}

/// Largest change of the level of a grain, as a factor: 12 dB.
const MAX_LEVELLING: f64 = 4.0;

/// The sources of a kind whose tags share the most words with those wanted, and a notice if some words, or the kind, are missing.
///
/// A dictionary without sources of the kind offers those of the other one.
#[must_use]
pub fn sources_of(
    dictionary: &GrainDictionary,
    wanted: &str,
    kind: SourceKind,
) -> (Vec<usize>, Option<String>) {
    let has_grains = |k: &usize| dictionary.grains.iter().any(|g| g.source as usize == *k);
    let with_grains: Vec<usize> = (0..dictionary.sources.len()).filter(has_grains).collect();
    let of_kind: Vec<usize> =
        with_grains.iter().copied().filter(|k| dictionary.sources[*k].kind == kind).collect();
    let is_missing = of_kind.is_empty();
    let all = if is_missing { with_grains } else { of_kind };
    let (found, is_exact) = matching_tags(wanted, all.iter().map(|k| dictionary.sources[*k].tags.as_slice()));
    let chosen: Vec<usize> =
        if found.is_empty() { all.clone() } else { found.iter().map(|k| all[*k]).collect() };
    let Some(used) = chosen.first().map(|k| &dictionary.sources[*k]) else { return (chosen, None) };
    let name = used.name.rsplit('/').next().unwrap_or_default();
    let word = if kind == SourceKind::Impulsive { "impulsive" } else { "continuous" };
    let notice = if is_missing {
        Some(format!("no recording is {word}; others, such as {name}, are used for {wanted:?}"))
    } else if is_exact {
        None
    } else {
        Some(format!("no {word} recording has all tags of {wanted:?}; the nearest, such as {name}, are used"))
    };
    (chosen, notice)
}

/// The steps of a source: of its pattern, or else its grains in order.
fn steps_of(dictionary: &GrainDictionary, pattern: Option<&Pattern>, source: usize) -> Vec<GrainStep> {
    let from_pattern = pattern.map(|pattern| walk(pattern, dictionary, GapRule::Extend));
    from_pattern.filter(|steps| !steps.is_empty()).unwrap_or_else(|| {
        let own = dictionary.grains.iter().enumerate().filter(|(_, g)| g.source as usize == source);
        own.map(|(k, g)| GrainStep { grain: k as u32, t: g.window_start() as i64, gain: 1.0 }).collect()
    })
}

/// The pattern of a source.
fn pattern_of<'a>(patterns: Option<&'a CorrelationPatterns>, source: &GrainSource) -> Option<&'a Pattern> {
    let is_of_source = |p: &&Pattern| p.name == source.name && p.component == source.component;
    patterns.and_then(|all| all.patterns.iter().find(is_of_source))
}

/// Correlation of two variations at which one of them is left out.
const ALIKE: f64 = 0.95;
/// Attempts to find a variation that is unlike all others.
const ATTEMPTS: usize = 4;

/// The sound of segments, channels averaged, with unit energy, and its energy.
pub(crate) fn rendered(dictionary: &GrainDictionary, segments: &[GrainSegment]) -> (Vec<f32>, f64) {
    let end = segments.iter().map(GrainSegment::end).max().unwrap_or(0).max(0);
    let mut out = vec![0.0; end as usize];
    segments.iter().for_each(|s| s.add(dictionary, 0, 1, &mut out));
    let energy: f64 = out.iter().map(|x| f64::from(*x).powi(2)).sum();
    let scale = if energy > 0.0 { energy.sqrt().recip() as f32 } else { 0.0 };
    out.iter_mut().for_each(|x| *x *= scale);
    (out, energy)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Impacts of the sources with some tags, in an order in which sources alternate, no two of them alike. They begin at frame 0 and have one
/// energy, up to the spread that remains.
#[must_use]
pub fn impact_sounds(
    dictionary: &GrainDictionary,
    patterns: Option<&CorrelationPatterns>,
    sources: &[usize],
    rules: &RepertoireRules,
    random: &Random,
) -> Vec<ImpactSound> {
    let variation =
        VariationRules { jitter: 0.001 * dictionary.rate, level: 1.0, ..VariationRules::default() };
    let mut sounds = Vec::new();
    let mut shapes: Vec<Vec<f32>> = Vec::new();
    let mut energies = Vec::new();
    let wanted = rules.variations.max(1) * sources.len();
    for round in 0..rules.variations.max(1) * ATTEMPTS {
        for (k, source) in sources.iter().enumerate().take(wanted - sounds.len()) {
            let pattern = dictionary.sources.get(*source).and_then(|s| pattern_of(patterns, s));
            let steps = match pattern.filter(|p| round > 0 && !p.is_sequence) {
                Some(pattern) => varied(pattern, dictionary, &variation, |index, lane| {
                    random.uniform(k as u32, (round as u64) << 32 | index, lane)
                }),
                // Without a pattern there is one variation.
                None if round > 0 => continue,
                None => steps_of(dictionary, pattern, *source),
            };
            let mut all = segments(dictionary, &steps);
            let Some(first) = all.first().map(|s| s.start) else { continue };
            all.iter_mut().for_each(|s| s.start -= first);
            let (shape, energy) = rendered(dictionary, &all);
            let alike = |other: &Vec<f32>| {
                let dot: f64 = shape.iter().zip(other).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                dot > ALIKE
            };
            if round > 0 && shapes.iter().any(alike) {
                continue;
            }
            let frames = all.iter().map(GrainSegment::end).max().unwrap_or(0);
            sounds.push(ImpactSound { segments: all, frames });
            shapes.push(shape);
            energies.push(energy);
        }
    }
    let common = median(energies.clone());
    for (sound, energy) in sounds.iter_mut().zip(energies) {
        let level = if energy > 0.0 { (common / energy).sqrt().powf(1.0 - rules.spread) } else { 0.0 };
        sound.segments.iter_mut().for_each(|s| s.gain *= level as f32);
    }
    sounds
}

/// Sounds of contact of the sources with some tags.
#[must_use]
pub fn contact_sounds(
    dictionary: &GrainDictionary,
    patterns: Option<&CorrelationPatterns>,
    sources: &[usize],
    rules: &RepertoireRules,
) -> Vec<ContactSound> {
    let sound = |k: &usize| {
        let source = dictionary.sources.get(*k)?;
        let steps = steps_of(dictionary, pattern_of(patterns, source), *k);
        // A chain needs a grain to follow the first.
        (steps.len() > 1).then_some(ContactSound { component: source.component, speed: source.speed, steps })
    };
    let mut sounds: Vec<ContactSound> = sources.iter().filter_map(sound).collect();
    let power = |step: &GrainStep| {
        let own = dictionary.grains.get(step.grain as usize).map_or(0.0, |g| f64::from(g.power));
        own * f64::from(step.gain).powi(2)
    };
    for component in [Component::Whole, Component::Steady, Component::Transient] {
        let of_component = sounds.iter().filter(|s| s.component == component);
        let common = median(of_component.flat_map(|s| s.steps.iter().map(power)).collect());
        for step in sounds.iter_mut().filter(|s| s.component == component).flat_map(|s| &mut s.steps) {
            let ratio = (common / power(step).max(1e-20)).sqrt().powf(1.0 - rules.spread);
            step.gain *= ratio.clamp(1.0 / MAX_LEVELLING, MAX_LEVELLING) as f32;
        }
    }
    sounds
}
