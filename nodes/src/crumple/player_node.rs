//! The node around [`Player`].

use super::CrumpleBank;
use super::item::MatchedCrumple;
use super::player::Player;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Retune, Summary};
use crate::core::params::Params;
use crate::core::ports::{Events, Stream, Value};
use crate::core::random::{Draw, Random};
use crate::core::shape::{Build, Shape};
use crate::core::time::{Rate, Tick, ticks};
use crate::{choices, params, ports};

choices! {
    /// How much later than its event a sample begins.
    pub enum Jitter {
        /// Anything from 0 to the shortest whole number of frames that is no less than `jitter_time`: only whole frames hide the
        /// frame rate of the motion completely.
        WholeFrames,
        /// As much, but around the event: half of the samples begin before it.
        Centred,
        /// Anything from 0 to `jitter_time`, as the paper may be read.
        Fixed,
        /// Not at all: all samples of a frame begin at once.
        Off,
    }
}

params! {
    /// Plays a recorded sample for each crumple.
    ///
    /// Samples begin at the time of their event and a little later, at random, since motion knows whole frames only: without that, all folds of
    /// a frame snap at once and the frame rate is heard. They are as loud as they were recorded, and overlap. A bank of another
    /// rate is brought to `rate` first. This node makes audio from something that is none, so it has a sample rate of its own.
    ///
    /// # Randomness
    /// How much later a sample begins follows from the seed, the time of the event and its lowest vertex alone.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3, who jitter by 1/30 s and
    /// do not say how.
    pub struct CrumplePlayerParams {
        /// How much later than its event a sample begins.
        jitter: Jitter = Jitter::WholeFrames;
        /// Spread of the beginnings.
        jitter_time: f64 = 0.033333333333333, unit "s", range 0.0..=0.2;
        /// Factor on everything.
        gain: f32 = 1.0, unit "", range 0.0..=1000.0;
        /// Whether a sample is scaled to exactly the energy that it should have, by 6 dB at most.
        match_gain: bool = false;
        /// Samples that sound at once; of more, those with the least energy left give way. 64 is good for live use.
        max_voices: usize = 4096, unit "voices", range 1..=65_536;
        /// How long it goes on after the last event: jitter and the longest sample.
        tail: f64 = 0.6, unit "s", range 0.0..=60.0;
        /// Samples per second.
        rate: Rate = Rate::hz(48_000);
    }
}
ports! {
    pub struct CrumplePlayerPorts / CrumplePlayerIo {
        in {
            /// The events, with the numbers of their samples.
            matched: Events<MatchedCrumple>,
            /// The samples.
            bank: Value<CrumpleBank>,
        }
        out {
            /// Mono crumple sound, full scale +-1.
            audio: Stream<f32>,
        }
    }
}

/// The longest that a frame of the motion may last for whole frames of jitter, s.
const SLOWEST: f64 = 0.1;
/// Most that `match_gain` changes, as a factor of amplitude: 6 dB.
const MOST_GAIN: f64 = 1.995_262_314_968_879_5;

/// The node `CrumplePlayer`.
pub struct CrumplePlayer {
    player: Player,
    energies: Vec<f64>,
    bank: u32,
    /// Energies of the bank are at its own rate, those wanted too.
    params: CrumplePlayerParams,
    random: Random,
    /// Ticks that it looks ahead, for samples that begin before their event.
    ahead: Tick,
    next: Option<Tick>,
    played: u64,
}

fn ahead(p: &CrumplePlayerParams) -> Tick {
    match p.jitter {
        Jitter::Centred => ticks(0.5 * (p.jitter_time + SLOWEST)),
        _ => 0,
    }
}

/// Spread of the beginnings for frames of `interval` ticks.
fn spread(p: &CrumplePlayerParams, interval: Tick) -> Tick {
    let time = ticks(p.jitter_time);
    match p.jitter {
        Jitter::Off => 0,
        Jitter::Fixed => time,
        Jitter::WholeFrames | Jitter::Centred => {
            let frame = interval.clamp(1, ticks(SLOWEST));
            let frames = (time as f64 / frame as f64 - 1e-6).ceil().max(0.0) as Tick;
            frame * frames
        }
    }
}

impl CrumplePlayer {
    /// Ticks from an event to the beginning of its sample.
    fn delay(&self, tick: Tick, event: &MatchedCrumple) -> Tick {
        let spread = spread(&self.params, event.interval);
        let centre = if self.params.jitter == Jitter::Centred { spread / 2 } else { 0 };
        let draw = self.random.uniform(event.id, tick as u64, 0);
        (draw * spread as f64) as Tick - centre
    }

    fn gain(&self, event: &MatchedCrumple) -> f32 {
        let energy = self.energies.get(event.sample as usize).copied().unwrap_or(0.0);
        let matched = if self.params.match_gain && energy > 0.0 {
            (event.wanted / energy).sqrt().clamp(1.0 / MOST_GAIN, MOST_GAIN) as f32
        } else {
            1.0
        };
        self.params.gain * matched
    }
}

impl Node for CrumplePlayer {
    type Params = CrumplePlayerParams;
    type Ports = CrumplePlayerPorts;
    const NAME: &'static str = "CrumplePlayer";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &CrumplePlayerParams, s: &mut Shape<'_, '_, CrumplePlayerPorts>) -> Result<(), Reject> {
        s.reach(CrumplePlayerPorts::matched, 0, ahead(p) as usize);
        s.tail(ticks(p.tail));
        s.output(CrumplePlayerPorts::audio, p.rate, Channels(1));
        Ok(())
    }

    fn build(p: &CrumplePlayerParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let wrong = |e: super::BankError| Fault::new("F106", e.to_string()).at("bank");
        let bank = cx.value(CrumplePlayerPorts::bank);
        bank.validate().map_err(wrong)?;
        let id = bank.id();
        let player = Player::new(&bank.resampled(p.rate.as_f64()).map_err(wrong)?, p.max_voices);
        Ok(Self {
            player,
            energies: bank.energies.clone(),
            bank: id,
            params: p.clone(),
            random: cx.random,
            ahead: ahead(p),
            next: None,
            played: 0,
        })
    }

    fn run(&mut self, mut io: CrumplePlayerIo<'_>) -> Result<(), Fault> {
        let (rate, mut at) = (io.audio.rate(), io.audio.first());
        let mut out = io.audio.items();
        out.fill(0.0);
        let (from, to) = io.matched.window();
        let next = self.next.unwrap_or(from);
        for (tick, event) in io.matched.events().iter().filter(|(tick, _)| *tick >= next) {
            if event.bank != self.bank {
                let message = "the events were matched with another bank than the one that is to be played";
                let help = "link the same bank to HistogramMatcher and to CrumplePlayer";
                return Err(Fault::new("F106", message).at("bank").help(help).when(*tick));
            }
            let now = rate.first_at(*tick - self.ahead).clamp(at, at + out.len() as i64);
            let (before, after) = out.split_at_mut((now - at) as usize);
            self.player.read(at, before);
            (at, out) = (now, after);
            let start = rate.first_at((*tick + self.delay(*tick, event)).max(0));
            let gain = self.gain(event);
            self.player.begin(event.sample as usize, start, gain, now);
            self.played += 1;
        }
        self.player.read(at, out);
        self.next = Some(to + self.ahead);
        Ok(())
    }

    fn finish(&mut self, _: CrumplePlayerIo<'_>) -> Result<Summary, Fault> {
        let (stolen, at_once) = self.player.told();
        let mut told: Summary = vec![("played", self.played.into()), ("at_once_at_most", at_once.into())];
        if stolen > 0 {
            told.push(("stolen", stolen.into()));
        }
        Ok(told)
    }

    fn retune(&mut self, new: &CrumplePlayerParams) -> Retune {
        let CrumplePlayerParams { gain, match_gain, .. } = *new;
        if (CrumplePlayerParams { gain, match_gain, ..self.params.clone() }) != *new {
            return Retune::Rebuild;
        }
        // What sounds keeps its gain; the next sample has the new one.
        (self.params.gain, self.params.match_gain) = (gain, match_gain);
        Retune::Done
    }

    fn adopt(&mut self, old: &mut Self) {
        if (self.bank, self.params.rate) == (old.bank, old.params.rate) {
            self.player.take_state(&old.player);
        }
        self.played = old.played;
    }

    fn trial(draw: &mut Draw) -> (CrumplePlayerParams, MemoryFiles) {
        let rate = Rate::hz([4000, 8000, 8820][draw.below(3)]);
        let (max_voices, tail) = (1 + draw.below(20), draw.between(0.0, 0.1));
        let p = CrumplePlayerParams { rate, max_voices, tail, ..CrumplePlayerParams::trial(draw) };
        (CrumplePlayerParams { gain: p.gain.min(2.0), ..p }, MemoryFiles::default())
    }
}

#[cfg(test)]
#[path = "player_node_tests.rs"]
mod tests;
