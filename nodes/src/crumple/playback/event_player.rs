//! EventPlayer of matched events, for one channel and for two ears.

use super::onset_timing::{Jitter, JitterParams};
use super::playback_params::PlaybackParams;
use super::voices::{Onset, Player, VoiceFilter};
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

/// Maximum factor of amplitude from matched gains: 6 dB.
const MAX_GAIN: f64 = 1.995_262_314_968_879_5;

/// Plays the samples of events through a [`VoiceFilter`].
pub(super) struct EventPlayer<F> {
    player: Player<F>,
    /// Energies of the samples at the rate of the bank.
    energies: Vec<f64>,
    bank: u32,
    onset: JitterParams,
    playback: PlaybackParams,
    random: Random,
    ahead: Tick,
    /// End of the events that were handled.
    next: Option<Tick>,
    played: u64,
}

impl<F: Serialize + DeserializeOwned> Stateful for EventPlayer<F> {
    archive_state!(player, next, played);
}

impl<F: VoiceFilter> EventPlayer<F> {
    /// Resamples a bank to the rate of the output. `margins` are the frames of output before and after a sample.
    pub fn new(
        bank: &CrumpleBank,
        (onset, playback): (&JitterParams, &PlaybackParams),
        margins: [usize; 2],
        random: Random,
    ) -> Result<Self, Fault> {
        let wrong = |e: BankError| Fault::new("F106", e.to_string()).at("bank");
        bank.validate().map_err(wrong)?;
        let resampled = bank.resampled(playback.rate.as_f64()).map_err(wrong)?;
        Ok(Self {
            player: Player::new(&resampled, playback.max_voices, margins),
            energies: bank.energies.clone(),
            bank: bank.id(),
            ahead: onset.ahead(margins[0], playback.rate),
            onset: onset.clone(),
            playback: playback.clone(),
            random,
            next: None,
            played: 0,
        })
    }

    /// Returns the ticks from an event to the beginning of its sample.
    fn delay(&self, tick: Tick, event: &MatchedCrumple) -> Tick {
        let spread = self.onset.spread(event.interval);
        let centre = if self.onset.jitter == Jitter::Centred { spread / 2 } else { 0 };
        let draw = self.random.uniform(event.id, tick as u64, 0);
        (draw * spread as f64) as Tick - centre
    }

    /// Returns the gain of an event.
    fn gain(&self, event: &MatchedCrumple) -> f32 {
        let energy = self.energies.get(event.sample as usize).copied().unwrap_or(0.0);
        let matched = if self.playback.match_gain && energy > 0.0 {
            (event.wanted / energy).sqrt().clamp(1.0 / MAX_GAIN, MAX_GAIN) as f32
        } else {
            1.0
        };
        self.playback.gain * matched
    }

    /// Plays a window. `filter` returns the filter of a position at a time.
    pub fn run(
        &mut self,
        matched: &EventsIn<'_, MatchedCrumple>,
        audio: &mut Out<'_, f32>,
        filter: impl Fn([f32; 3], Tick) -> F,
    ) -> Result<(), Fault> {
        let (rate, mut frame) = (audio.rate(), audio.first());
        let mut out = audio.items();
        out.fill(0.0);
        let (from, to) = matched.window();
        let next = self.next.unwrap_or(from);
        let filter_at = |position, start| filter(position, rate.tick(start));
        for (tick, event) in matched.events().iter().filter(|(tick, _)| *tick >= next) {
            if event.bank != self.bank {
                let message = "the events were matched with another bank than `bank`";
                let help = "link the same bank to HistogramMatcher and to the player";
                return Err(Fault::new("F106", message).at("bank").help(help).when(*tick));
            }
            let frames = (out.len() / F::CHANNELS) as i64;
            let now = rate.first_at(*tick - self.ahead).clamp(frame, frame + frames);
            let (before, after) = out.split_at_mut((now - frame) as usize * F::CHANNELS);
            self.player.read(frame, before, filter_at);
            (frame, out) = (now, after);
            let onset = Onset {
                sample: event.sample as usize,
                start: rate.first_at((*tick + self.delay(*tick, event)).max(0)),
                gain: self.gain(event),
                position: event.position,
            };
            self.player.begin(onset, now, filter(event.position, rate.tick(now)));
            self.played += 1;
        }
        self.player.read(frame, out, filter_at);
        self.next = Some(to + self.ahead);
        Ok(())
    }

    /// Changes the gains of following samples. Sounding voices have their own gains.
    pub fn set_gains(&mut self, playback: &PlaybackParams) {
        self.playback = self.playback.with_gains_of(playback);
    }

    /// Adopts the voices of another player of the same bank and rate.
    pub fn adopt(&mut self, old: &Self) {
        if (self.bank, self.playback.rate) == (old.bank, old.playback.rate) {
            self.player.take_state(&old.player);
        }
        self.played = old.played;
    }

    /// Returns the summary for the report.
    pub fn summary(&self) -> Summary {
        let (stolen, max_sounding) = self.player.statistics();
        let mut summary: Summary =
            vec![("played", self.played.into()), ("at_once_at_most", max_sounding.into())];
        if stolen > 0 {
            summary.push(("stolen", stolen.into()));
        }
        summary
    }
}
