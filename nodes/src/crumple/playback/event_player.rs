//! What the nodes that play crumples share: when samples begin, how loud they are, and the player.

use super::onset_timing::{Jitter, Timing};
use super::voices::{Hearing, Onset, Player};
use crate::archive_state;
use crate::core::fault::Fault;
use crate::core::node::Summary;
use crate::core::ports::{EventsIn, Out};
use crate::core::random::Random;
use crate::core::state::Stateful;
use crate::core::time::Tick;
use crate::crumple::bank::{BankError, CrumpleBank};
use crate::crumple::matching::MatchedCrumple;
use serde::{Serialize, de::DeserializeOwned};

/// Most that matched gains change, as a factor of amplitude: 6 dB.
const MOST_GAIN: f64 = 1.995_262_314_968_879_5;

/// Plays the samples of events, whatever is heard of them.
pub(super) struct Playback<H> {
    player: Player<H>,
    energies: Vec<f64>,
    bank: u32,
    /// Energies of the bank are at its own rate, those wanted too.
    timing: Timing,
    random: Random,
    ahead: Tick,
    next: Option<Tick>,
    played: u64,
}

impl<H: Serialize + DeserializeOwned> Stateful for Playback<H> {
    archive_state!(player, next, played);
}

impl<H: Hearing> Playback<H> {
    /// Brings a bank to the rate of the output; samples are heard as long before and after as `around` says, in frames.
    pub fn new(
        bank: &CrumpleBank,
        timing: Timing,
        around: [usize; 2],
        random: Random,
    ) -> Result<Self, Fault> {
        let wrong = |e: BankError| Fault::new("F106", e.to_string()).at("bank");
        bank.validate().map_err(wrong)?;
        let resampled = bank.resampled(timing.rate.as_f64()).map_err(wrong)?;
        Ok(Self {
            player: Player::new(&resampled, timing.max_voices, around),
            energies: bank.energies.clone(),
            bank: bank.id(),
            ahead: timing.ahead(around[0]),
            timing,
            random,
            next: None,
            played: 0,
        })
    }

    /// Ticks from an event to the beginning of its sample.
    fn delay(&self, tick: Tick, event: &MatchedCrumple) -> Tick {
        let spread = self.timing.spread(event.interval);
        let centre = if self.timing.jitter == Jitter::Centred { spread / 2 } else { 0 };
        let draw = self.random.uniform(event.id, tick as u64, 0);
        (draw * spread as f64) as Tick - centre
    }

    fn gain(&self, event: &MatchedCrumple) -> f32 {
        let energy = self.energies.get(event.sample as usize).copied().unwrap_or(0.0);
        let matched = if self.timing.match_gain && energy > 0.0 {
            (event.wanted / energy).sqrt().clamp(1.0 / MOST_GAIN, MOST_GAIN) as f32
        } else {
            1.0
        };
        self.timing.gain * matched
    }

    /// Plays a window; `heard` tells how something is heard from a place at a time.
    pub fn run(
        &mut self,
        matched: &EventsIn<'_, MatchedCrumple>,
        audio: &mut Out<'_, f32>,
        heard: impl Fn([f32; 3], Tick) -> H,
    ) -> Result<(), Fault> {
        let (rate, mut at) = (audio.rate(), audio.first());
        let mut out = audio.items();
        out.fill(0.0);
        let (from, to) = matched.window();
        let next = self.next.unwrap_or(from);
        let begins = |place, start| heard(place, rate.tick(start));
        for (tick, event) in matched.events().iter().filter(|(tick, _)| *tick >= next) {
            if event.bank != self.bank {
                let message = "the events were matched with another bank than the one that is to be played";
                let help = "link the same bank to HistogramMatcher and to the player";
                return Err(Fault::new("F106", message).at("bank").help(help).when(*tick));
            }
            let frames = (out.len() / H::CHANNELS) as i64;
            let now = rate.first_at(*tick - self.ahead).clamp(at, at + frames);
            let (before, after) = out.split_at_mut((now - at) as usize * H::CHANNELS);
            self.player.read(at, before, begins);
            (at, out) = (now, after);
            let onset = Onset {
                sample: event.sample as usize,
                start: rate.first_at((*tick + self.delay(*tick, event)).max(0)),
                gain: self.gain(event),
                place: event.position,
            };
            self.player.begin(onset, now, heard(event.position, rate.tick(now)));
            self.played += 1;
        }
        self.player.read(at, out, begins);
        self.next = Some(to + self.ahead);
        Ok(())
    }

    /// Takes other gains over: what sounds keeps its own, the next sample has the new one.
    pub fn set_gain(&mut self, gain: f32, match_gain: bool) {
        (self.timing.gain, self.timing.match_gain) = (gain, match_gain);
    }

    /// Goes on as another one would.
    pub fn adopt(&mut self, old: &Self) {
        if (self.bank, self.timing.rate) == (old.bank, old.timing.rate) {
            self.player.take_state(&old.player);
        }
        self.played = old.played;
    }

    /// What there is to tell in the end.
    pub fn summary(&self) -> Summary {
        let (stolen, at_once) = self.player.told();
        let mut told: Summary = vec![("played", self.played.into()), ("at_once_at_most", at_once.into())];
        if stolen > 0 {
            told.push(("stolen", stolen.into()));
        }
        told
    }
}
