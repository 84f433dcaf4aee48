//! The node `GrainRetarget`.

use super::chain::ChainRules;
use super::contact_pairs::ContactPairs;
use super::impact_voices::{ImpactVoices, Voice};
use super::repertoire::{ImpactSound, RepertoireRules, contact_sounds, impact_sounds, sources_of};
use super::selection::{check_patterns, check_rate};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::{Params, Text};
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::{Random, Rng};
use crate::core::shape::{Build, Shape};
use crate::core::silence::Silence;
use crate::core::time::{Rate, Tick, ticks};
use crate::core::unmatched::Unmatched;
use crate::dsp::{Trigger, db_to_linear};
use crate::grain::correlation::CorrelationPatterns;
use crate::grain::dictionary::GrainDictionary;
use crate::grain::recording::SourceKind;
use crate::modal::Impact;
use crate::rigid::ContactState;
use crate::{archive_state, params, ports};
use std::sync::Arc;

params! {
    /// Plays grains of recordings that follow contacts: impacts, sliding and rolling.
    ///
    /// An impact plays a recording of an impact whose tags are those of `impact`, with an amplitude that follows its energy. With patterns each
    /// recording has `variations`, whose grains are exchanged for similar ones, so that no two impacts are equal. Sliding and rolling play
    /// chains of grains of continuous recordings, one after the other, at any rate of the physics, with a level that follows the
    /// power of the contact. The frequency of the steady part follows the speed; the transient part remains as it was recorded. With `tracks` of
    /// the dictionary a steady grain has the duration of its recording at any frequency; without them it is played faster or slower. All
    /// contacts of two bodies are one chain. Rubbing at another speed may not change the spectrum, while a load widens its peaks: `gamma: 0`
    /// with `width_by_load` follows that.
    ///
    /// Triggers play impacts without physics: a trigger of index `k` a recording whose tags are those of entry `k` of `triggered`, at the speed of
    /// its ratio, which also multiplies the frequency. Tags without recordings are replaced by the nearest, with a warning.
    ///
    /// # Randomness
    /// The choice of an impact and of the grains of a chain are functions of the seed, the bodies and the number of the grain.
    ///
    /// # Source
    /// Picard, Tsingos and Faure, "Retargetting Example Sounds to Interactive Physics-Driven Animations" (AES 35, 2009), section 4.2. The
    /// paper gives no law for the frequency; `(speed / speed_ref)^gamma` is of this project.
    pub struct GrainRetargetParams {
        /// Tags of impacts.
        impact: Text = "".into();
        /// Tags of sliding.
        sliding: Text = "slide scrape".into();
        /// Tags of rolling.
        rolling: Text = "roll rolling".into();
        /// Tags of breaking, for impacts of at least `break_energy`; a trigger has no energy.
        breaking: Text = "break".into();
        /// Tags of the sounds of triggers, by their index; a trigger of another index plays an impact.
        triggered: Vec<Text> = Vec::new();
        /// Body whose impacts and contacts sound; None for all.
        object: Option<u32> = None, unit "", range 0..=u32::MAX;
        /// Energy at which an impact has the level of the recordings.
        energy_ref: f64 = 0.1, unit "J", range 1e-12..=1.0e9_f64;
        /// Smallest and largest gain of an impact; below the smallest it is silent.
        range: [f64; 2] = [-60.0, 12.0], unit "dB", range -200.0..=60.0;
        /// Minimum energy of an impact that plays the whole recording; a weaker one plays its first grain only.
        whole_energy: f64 = 0.0, unit "J", range 0.0..=1.0e9_f64;
        /// Minimum energy of an impact that breaks something.
        break_energy: Option<f64> = None, unit "J", range 0.0..=1.0e9_f64;
        /// Variations of each recorded impact.
        variations: usize = 64, unit "", range 1..=1024;
        /// Share of the recorded differences of level between grains, and between impacts, that remains.
        spread: f64 = 0.0, unit "", range 0.0..=1.0;
        /// Speed of recordings without one of their own.
        speed_ref: f64 = 0.5, unit "m/s", range 0.000001..=1000.0;
        /// Exponent of the speed in the frequency of the steady part; 0 leaves it as recorded.
        gamma: f64 = 0.5, unit "", range 0.0..=4.0;
        /// Widening of the spectral peaks of the steady part: the greatest random shift of a grain for each newton of normal force.
        width_by_load: f64 = 0.0, unit "octaves/N", range 0.0..=1000.0;
        /// Probability that a grain of a chain is followed by one of another time.
        jump: f64 = 0.05, unit "", range 0.0..=1.0;
        /// Level of the steady part.
        steady: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Level of the transient part.
        transient: f64 = 0.0, unit "dB", range -200.0..=60.0;
        /// Factor on the output.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Maximum number of simultaneous impacts, and of pairs of bodies in contact.
        voices: u16 = 64, unit "voices", range 1..=1024_u16;
        /// Duration of the output after the last event.
        tail: f64 = 2.0, unit "s", range 0.0..=600.0;
        /// Channels of the output; recordings of more are averaged to one.
        channels: u16 = 1, unit "", range 1..=8_u16;
        /// Sample rate of the audio, that of the dictionary.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct GrainRetargetPorts / GrainRetargetIo {
        in {
            /// The grains.
            dictionary: Value<GrainDictionary>,
            /// Patterns of the recordings, for variations.
            patterns: Option<Value<CorrelationPatterns>>,
            /// Impacts.
            impacts: Option<Events<Impact>>,
            /// Contacts with their classification.
            states: Option<Events<ContactState>>,
            /// Impacts without physics, with their amplitude, index and ratio.
            triggers: Option<Events<Trigger>>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
        }
    }
}

/// Index of the list of impacts, and of that of breaking; those of `triggered` follow.
const IMPACT: usize = 0;
const BREAKING: usize = 1;
const TRIGGERED: usize = 2;

/// The node `GrainRetarget`.
#[derive(Debug)]
pub struct GrainRetarget {
    params: GrainRetargetParams,
    dictionary: Arc<GrainDictionary>,
    /// Digest of the dictionary.
    digest: String,
    /// Sounds of impacts, by list.
    sounds: Vec<Vec<ImpactSound>>,
    contacts: ContactPairs,
    random: Random,
    voices: ImpactVoices,
    /// Impacts so far, by list.
    impact_counts: Vec<u64>,
    /// Events that are not finite, or whose ratio is out of range.
    not_finite: u64,
    /// Impacts on other objects.
    others: Unmatched<u32>,
    scratch: Vec<f32>,
    notices: Vec<String>,
}

impl GrainRetarget {
    fn rules(&self) -> ChainRules {
        let p = &self.params;
        let level = |db: f64| db_to_linear(db) as f32;
        ChainRules {
            jump: p.jump,
            gamma: p.gamma,
            speed: p.speed_ref,
            width: p.width_by_load,
            levels: [level(p.steady), level(p.transient)],
        }
    }

    /// The list that an impact plays.
    fn list_of_energy(&self, energy: f64) -> usize {
        let breaks = self.params.break_energy.is_some_and(|limit| energy >= limit);
        if breaks && !self.sounds[BREAKING].is_empty() { BREAKING } else { IMPACT }
    }

    /// The list that a trigger plays.
    fn list_of_index(&self, index: u32) -> usize {
        let own = (index as usize).saturating_add(TRIGGERED);
        if self.sounds.get(own).is_some_and(|sounds| !sounds.is_empty()) { own } else { IMPACT }
    }

    /// Plays the next sound of a list at a frame.
    fn strike(&mut self, list: usize, segments: u32, amplitude: f64, ratio: f32, frame: i64) {
        let p = &self.params;
        let [low, high] = p.range.map(db_to_linear);
        let count = self.impact_counts[list];
        self.impact_counts[list] += 1;
        let sounds = self.sounds[list].len() as u64;
        if sounds == 0 || amplitude < low {
            return;
        }
        // All sounds occur once before one occurs again; each round has its own order.
        let (round, position) = (count / sounds, count % sounds);
        let shift = (self.random.uniform(list as u32, round, 7) * sounds as f64) as u64;
        let voice = Voice {
            list: list as u32,
            sound: ((position + shift) % sounds) as u32,
            segments,
            start: frame,
            gain: amplitude.min(high) as f32,
            ratio,
            stop: None,
        };
        self.voices.begin(&self.sounds, voice, p.rate.as_f64());
    }

    /// Plays an impact at a frame.
    fn strike_by_energy(&mut self, energy: f64, frame: i64) {
        let list = self.list_of_energy(energy);
        let is_whole = list == BREAKING || energy >= self.params.whole_energy;
        let amplitude = (energy / self.params.energy_ref).sqrt();
        self.strike(list, if is_whole { u32::MAX } else { 1 }, amplitude, 1.0, frame);
    }

    /// Adds the frames from `first` on.
    fn render(&mut self, first: i64, out: &mut [f32]) {
        let channels = i64::from(self.params.channels);
        let rules = self.rules();
        // Blocks fit into the scratch buffer.
        let block = self.scratch.len() / channels as usize * channels as usize;
        for (k, out) in out.chunks_mut(block.max(1)).enumerate() {
            let at = [first + (k * block) as i64 / channels, channels];
            self.voices.add(&self.dictionary, &self.sounds, at, &mut self.scratch, out);
            self.contacts.add(&self.dictionary, &rules, &self.random, at, &mut self.scratch, out);
        }
    }

    /// Handles events in the order of their times.
    fn play(&mut self, io: &mut GrainRetargetIo<'_>) {
        let rate = io.audio.rate();
        let width = usize::from(self.params.channels);
        let (mut next, to) = (io.audio.first(), io.audio.first() + io.audio.len() as i64);
        let impacts: &[(Tick, Impact)] = io.impacts.as_ref().map_or(&[], |e| e.events());
        let states: &[(Tick, ContactState)] = io.states.as_ref().map_or(&[], |e| e.events());
        let triggers: &[(Tick, Trigger)] = io.triggers.as_ref().map_or(&[], |e| e.events());
        let mut out = io.audio.items();
        out.fill(0.0);
        let (mut i, mut j, mut k) = (0, 0, 0);
        loop {
            let times =
                [impacts.get(i).map(|e| e.0), states.get(j).map(|e| e.0), triggers.get(k).map(|e| e.0)];
            let Some(tick) = times.into_iter().flatten().min() else { break };
            let frame = rate.first_at(tick).clamp(next, to);
            self.contacts.advance(tick, rate);
            let (now, later) = out.split_at_mut((frame - next) as usize * width);
            self.render(next, now);
            (next, out) = (frame, later);
            if times[1] == Some(tick) {
                self.contacts.take(tick, &states[j].1, rate);
                j += 1;
            } else if times[0] == Some(tick) {
                let impact = &impacts[i].1;
                i += 1;
                if self.params.object.is_some_and(|object| object != impact.object) {
                    self.others.add(impact.object);
                } else if !impact.is_valid() {
                    self.not_finite += 1;
                } else {
                    self.strike_by_energy(f64::from(impact.energy), frame);
                }
            } else {
                let trigger = triggers[k].1;
                k += 1;
                if trigger.is_valid() {
                    let list = self.list_of_index(trigger.index);
                    let amplitude = f64::from(trigger.gain).abs();
                    self.strike(list, u32::MAX, amplitude, trigger.ratio, frame);
                } else {
                    self.not_finite += 1;
                }
            }
        }
        self.contacts.advance(rate.tick(to), rate);
        self.render(next, out);
    }
}

impl Node for GrainRetarget {
    type Params = GrainRetargetParams;
    type Ports = GrainRetargetPorts;
    const NAME: &'static str = "GrainRetarget";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 30.0;
    const VERSION: u32 = 2;

    fn shape(p: &GrainRetargetParams, s: &mut Shape<'_, '_, GrainRetargetPorts>) -> Result<(), Reject> {
        if p.range[1] < p.range[0] {
            let message =
                format!("`range` is {} to {} dB; the smaller gain comes first", p.range[0], p.range[1]);
            return Err(Reject::new("F134", message).at("range"));
        }
        let has_triggers = s.linked(GrainRetargetPorts::triggers);
        let has_impacts = s.linked(GrainRetargetPorts::impacts) || has_triggers;
        let has_contacts = s.linked(GrainRetargetPorts::states);
        if !has_impacts && !has_contacts {
            let reject = Reject::new("F150", "nothing plays the grains").at("impacts");
            return Err(reject.help("link `impacts`, `states` or `triggers`"));
        }
        s.prepare([has_impacts, has_contacts, has_triggers]);
        s.tail(ticks(p.tail));
        s.output(GrainRetargetPorts::audio, p.rate, Channels(p.channels));
        Ok(())
    }

    fn build(p: &GrainRetargetParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let dictionary = cx.value(GrainRetargetPorts::dictionary);
        let patterns = cx.optional_value(GrainRetargetPorts::patterns);
        check_rate(&dictionary, p.rate)?;
        if let Some(patterns) = &patterns {
            check_patterns(patterns, &dictionary)?;
        }
        let patterns = patterns.as_deref();
        let rules = RepertoireRules { variations: p.variations, spread: p.spread };
        let mut notices = Vec::new();
        let [has_impacts, has_contacts, has_triggers] =
            cx.prepared::<[bool; 3]>().map_or([true; 3], |linked| *linked);
        let mut find = |wanted: &str, kind: SourceKind| {
            if !(if kind == SourceKind::Impulsive { has_impacts } else { has_contacts }) {
                return Vec::new();
            }
            let (sources, notice) = sources_of(&dictionary, wanted, kind);
            notices.extend(notice);
            sources
        };
        let breaking = p.break_energy.map(|_| &p.breaking);
        let triggered = p.triggered.iter().map(|tags| has_triggers.then_some(tags));
        let lists = [Some(&p.impact), breaking].into_iter().chain(triggered);
        let sources_of_lists: Vec<Vec<usize>> = lists
            .map(|tags| tags.map_or_else(Vec::new, |tags| find(&tags.0, SourceKind::Impulsive)))
            .collect();
        let kinds = [&p.sliding.0, &p.rolling.0].map(|tags| find(tags, SourceKind::Continuous));
        let contacts = kinds.map(|sources| contact_sounds(&dictionary, patterns, &sources, &rules));
        let sounds_of =
            |sources: &Vec<usize>| impact_sounds(&dictionary, patterns, sources, &rules, &cx.random);
        let sounds: Vec<Vec<ImpactSound>> = sources_of_lists.iter().map(sounds_of).collect();
        let window = cx.items_per_window(p.rate).max(256);
        Ok(Self {
            contacts: ContactPairs::new(p.voices.into(), p.object, contacts),
            random: cx.random,
            voices: ImpactVoices::new(p.voices.into()),
            impact_counts: vec![0; sounds.len()],
            sounds,
            not_finite: 0,
            others: Unmatched::default(),
            scratch: vec![0.0; window.min(65_536) * usize::from(p.channels)],
            notices,
            digest: dictionary.id(),
            dictionary,
            params: p.clone(),
        })
    }

    fn run(&mut self, mut io: GrainRetargetIo<'_>) -> Result<(), Fault> {
        self.play(&mut io);
        if self.params.gain != 1.0 {
            let gain = self.params.gain;
            io.audio.items().iter_mut().for_each(|x| *x *= gain);
        }
        Ok(())
    }

    fn finish(&mut self, _: GrainRetargetIo<'_>) -> Result<Summary, Fault> {
        let contacts = &self.contacts;
        let mut summary: Summary = vec![
            ("impacts", self.impact_counts.iter().sum::<u64>().into()),
            ("contact_frames", contacts.frames.into()),
            ("pairs", contacts.count.into()),
        ];
        summary.push(("impact_sounds", self.sounds[IMPACT].len().into()));
        for (name, count) in [
            ("stolen", self.voices.stolen),
            ("not_finite", self.not_finite + contacts.not_finite),
            ("dropped", contacts.dropped),
        ] {
            if count > 0 {
                summary.push((name, count.into()));
            }
        }
        summary.extend(self.notices.iter().map(|text| ("warning", text.clone().into())));
        Ok(summary)
    }

    fn silence(&self) -> Option<Silence> {
        if self.impact_counts.iter().any(|count| *count > 0) || self.contacts.count > 0 {
            return None;
        }
        let (object, others) = (self.params.object?, self.contacts.others);
        let contacts = (!others.is_empty()).then_some(Silence::NoBody { object, others });
        Silence::no_object("impact", Some(object), self.others).or(contacts)
    }

    fn retune(&mut self, new: &GrainRetargetParams) -> Retune {
        let p = &mut self.params;
        let tags = [&p.impact, &p.sliding, &p.rolling, &p.breaking];
        let numbers =
            (p.object, p.break_energy, p.variations, p.spread, p.voices, p.tail, p.channels, p.rate);
        let new_numbers = (
            new.object,
            new.break_energy,
            new.variations,
            new.spread,
            new.voices,
            new.tail,
            new.channels,
            new.rate,
        );
        if tags != [&new.impact, &new.sliding, &new.rolling, &new.breaking]
            || p.triggered != new.triggered
            || numbers != new_numbers
        {
            return Retune::Rebuild;
        }
        (p.energy_ref, p.range, p.whole_energy) = (new.energy_ref, new.range, new.whole_energy);
        (p.speed_ref, p.gamma, p.jump) = (new.speed_ref, new.gamma, new.jump);
        p.width_by_load = new.width_by_load;
        (p.steady, p.transient, p.gain) = (new.steady, new.transient, new.gain);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if self.digest != old.digest {
            return;
        }
        if self.sounds.iter().map(Vec::len).eq(old.sounds.iter().map(Vec::len)) {
            self.voices.take_state(&old.voices);
        }
        self.contacts.take_state(&old.contacts);
        self.impact_counts.iter_mut().zip(&old.impact_counts).for_each(|(new, old)| *new = *old);
        (self.not_finite, self.others) = (old.not_finite, old.others);
    }

    archive_state!(voices, contacts, impact_counts, not_finite, others);

    fn trial(rng: &mut Rng) -> (GrainRetargetParams, MemoryFiles) {
        let params = GrainRetargetParams {
            impact: "trial".into(),
            rate: Rate::hz(8000),
            object: None,
            range: [-60.0, 12.0],
            variations: 1 + rng.below(4),
            voices: 1 + rng.below(5) as u16,
            channels: 1 + rng.below(2) as u16,
            tail: rng.between(0.0, 0.3),
            gain: 0.5,
            triggered: ["trial", "other"][..rng.below(3)].iter().map(|tags| (*tags).into()).collect(),
            ..GrainRetargetParams::trial(rng)
        };
        (params, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests;
