//! Concatenation as a node.

use std::sync::Arc;

use super::concatenator::{Blend, Concatenator, Join};
use super::repeats::{MEMORY, RepeatCounter};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, Summary, same_rate};
use crate::core::ports::{In, Stream, Value};
use crate::core::shape::{Build, Shape};
use crate::unit::silence::{SILENT, SilenceGate};
use crate::unit::{PickFormat, Picks, UnitDatabase};
use crate::{archive_state, choices, params, ports};

choices! { @param Blend {
    /// Powers add up to one: for unrelated sounds.
    EqualPower,
    /// Amplitudes add up to one: for similar sounds.
    Linear,
    /// Both at full level, as the paper can be read: 3 dB too loud where they overlap.
    Add,
} }

params! {
    /// Plays chosen units of a database one after the other, joined where they cross zero.
    ///
    /// At a join the earlier unit continues to its next zero crossing and the later one begins at the crossing before it, at most
    /// half a unit away; both are mixed in between. If a pick follows the previous one in its recording, the recording is
    /// reproduced bit for bit.
    ///
    /// With the sound of the target at `target`, a gate mutes the output in silence: 0.5 s after the target has gone silent (below
    /// -100 dBFS) the output fades to exact zeros in 50 ms; it fades in within 5 ms. The gate is also closed before the first sound
    /// of the target. A target that is shorter than one unit results in silence of its length.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.4. The paper
    /// adds without weights; equal power preserves the level. The gate is an addition.
    pub struct UnitConcatenatorParams {
        /// Mix of the sounds at a join.
        blend: Blend = Blend::EqualPower;
        /// Continue with room tone while the target is silent; None: only for joint (binaural) units.
        keep_room_tone: Option<bool> = None;
    }
}

ports! {
    pub struct UnitConcatenatorPorts / UnitConcatenatorIo {
        in {
            /// The chosen units.
            picks: Stream<Picks>,
            /// The database that they are of.
            database: Value<UnitDatabase>,
            /// Sound of the target: the output is muted where it is silent.
            target: Option<Stream<f32>>,
        }
        out {
            /// The sound.
            audio: Stream<f32>,
        }
    }
}

/// The node over [`Concatenator`].
pub struct UnitConcatenator {
    db: Arc<UnitDatabase>,
    blend: Blend,
    gate: Option<SilenceGate>,
    /// Units of the target, where it ends.
    length: Option<i64>,
    /// True if the target ends within its first unit, which is then dropped.
    short: bool,
    /// The unit whose joins are known, and its joins per channel.
    known: Option<i64>,
    joins: Vec<[Join; 2]>,
    /// Repeats of each channel of the picks.
    repeats: Vec<RepeatCounter>,
    /// Picks outside of the database, which are silent.
    outside: u64,
    muted_samples: u64,
}

/// Share of repeats above which a warning appears.
const MAX_REPEATS: f64 = 0.02;

/// Channels of the output.
fn channels(format: &PickFormat) -> u16 {
    format.channels.max(format.conventions.joined as usize) as u16
}

impl UnitConcatenator {
    /// Units before, at and after unit `k` of the output, in a channel of the picks.
    fn around(&self, picks: &In<'_, Picks>, channel: usize, k: i64) -> [Option<u32>; 3] {
        [k - 1, k, k + 1].map(|k| {
            let here = k >= 0 && self.length.is_none_or(|n| k < n);
            let pick = here.then(|| picks.item((k - picks.first()) as isize).get(channel).copied())?;
            u32::try_from(pick?.unit).ok().filter(|&unit| (unit as usize) < self.db.len())
        })
    }

    /// Writes samples `from..` of unit `k`.
    fn unit(&mut self, picks: &In<'_, Picks>, k: i64, from: usize, out: &mut [f32], width: usize) {
        let db = Arc::clone(&self.db);
        let concatenator = Concatenator::new(&db, self.blend);
        for channel in 0..width {
            let units = self.around(picks, channel.min(picks.width() - 1), k);
            let source = channel.min(db.channels() - 1);
            if self.known != Some(k) {
                if let Some(repeats) = self.repeats.get_mut(channel) {
                    let pick = picks.item((k - picks.first()) as isize).get(channel);
                    repeats.add(units[1].filter(|_| pick.is_some_and(|pick| !pick.asleep)));
                }
                self.outside += u64::from(units[1].is_none());
                self.joins[channel] = [(units[0], units[1]), (units[1], units[2])]
                    .map(|sides| concatenator.join(source, sides));
            }
            if let Some(out) = out.get_mut(channel..) {
                concatenator.play(source, units, self.joins[channel], from, out, width);
            }
        }
        self.known = Some(k);
    }
}

impl Node for UnitConcatenator {
    type Params = UnitConcatenatorParams;
    type Ports = UnitConcatenatorPorts;
    const NAME: &'static str = "UnitConcatenator";
    const VERSION: u32 = 4;
    const CLASS: Class = Class::Audio;
    const COST: f64 = 10.0;

    fn shape(p: &UnitConcatenatorParams, s: &mut Shape<'_, '_, UnitConcatenatorPorts>) -> Result<(), Reject> {
        let picks = s.input(UnitConcatenatorPorts::picks);
        let conventions = &picks.format.conventions;
        if let Some(db) = s.value(UnitConcatenatorPorts::database) {
            conventions.check("picks", &db.conventions, "database")?;
        }
        let fast = || Reject::new("F045", format!("units come at {}, too often", picks.rate)).at("picks");
        let rate = picks.rate.times(u64::from(conventions.unit)).ok_or_else(fast)?;
        if let Some(target) = s.optional(UnitConcatenatorPorts::target) {
            s.check(same_rate("target", target.rate, "the sound of `picks`", rate));
        }
        let _ = p;
        let width = channels(&picks.format);
        // The current unit began before the window, and is joined to the one before it and the one after.
        s.lookaround(UnitConcatenatorPorts::picks, 2, 1);
        s.ends(picks.end);
        s.output(UnitConcatenatorPorts::audio, rate, Channels(width));
        Ok(())
    }

    fn build(p: &UnitConcatenatorParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let picks = cx.input(UnitConcatenatorPorts::picks);
        let db = cx.value(UnitConcatenatorPorts::database);
        picks.format.conventions.check("picks", &db.conventions, "database")?;
        db.validate().map_err(|e| Fault::new("F101", e.to_string()).at("database"))?;
        let audio = cx.output(UnitConcatenatorPorts::audio);
        let keep = p.keep_room_tone.unwrap_or(db.conventions.joined > 1);
        let target = cx.optional(UnitConcatenatorPorts::target).is_some();
        Ok(Self {
            blend: p.blend,
            gate: (target && !keep).then(|| SilenceGate::new(audio.rate.as_f64())),
            length: picks.items(),
            short: picks.end.is_some_and(|end| end < picks.rate.tick(1)),
            known: None,
            joins: vec![Default::default(); audio.format.0.into()],
            repeats: (0..picks.format.channels).map(|_| RepeatCounter::new(picks.rate.as_f64())).collect(),
            outside: 0,
            muted_samples: 0,
            db,
        })
    }

    fn run(&mut self, mut io: UnitConcatenatorIo<'_>) -> Result<(), Fault> {
        if self.short {
            io.audio.items().fill(0.0);
            return Ok(());
        }
        let (unit, width) = (self.db.unit(), io.audio.width().max(1));
        let (mut at, mut out) = (io.audio.first().max(0), io.audio.items());
        while !out.is_empty() {
            let (k, from) = (at / unit as i64, (at % unit as i64) as usize);
            let frames = (unit - from).min(out.len() / width);
            let (now, rest) = std::mem::take(&mut out).split_at_mut(frames * width);
            self.unit(&io.picks, k, from, now, width);
            (at, out) = (at + frames as i64, rest);
        }
        if let (Some(gate), Some(target)) = (&mut self.gate, &io.target) {
            let frames = io.audio.items().chunks_exact_mut(width);
            for (frame, target_frame) in frames.zip(target.items().chunks_exact(target.width().max(1))) {
                let gain = gate.next(target_frame.iter().all(|x| x.abs() <= SILENT));
                self.muted_samples += u64::from(gain == 0.0);
                if gain < 1.0 {
                    frame.iter_mut().for_each(|x| *x *= gain);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, _: UnitConcatenatorIo<'_>) -> Result<Summary, Fault> {
        let [repeated, picks] = [|r: &RepeatCounter| r.repeated, |r: &RepeatCounter| r.picks]
            .map(|of| self.repeats.iter().map(of).sum::<u64>());
        let share = repeated as f64 / picks.max(1) as f64;
        let mut summary: Summary = vec![
            ("outside", self.outside.into()),
            ("asleep_samples", self.muted_samples.into()),
            ("repeats", share.into()),
        ];
        if share > MAX_REPEATS {
            let text = format!(
                "{:.0} % of the sound was played, in the same order, in the {MEMORY} s before, which is audible as a pattern: give more \
                 recordings, set `loop_guard: {MEMORY}` of the selector, or lower the `switch_cost` of a global one",
                100.0 * share
            );
            summary.push(("warning", text.into()));
        }
        Ok(summary)
    }

    archive_state!(known, joins, outside, muted_samples, each gate, each repeats);
}

#[cfg(test)]
mod tests;
