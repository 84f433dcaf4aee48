//! The node `InterauralCues`.

use super::cue_transfer::{CueFrames, CueTransfer};
use crate::core::fault::{Fault, Reject};
use crate::core::item::Channels;
use crate::core::node::{Class, Node, same_rate};
use crate::core::ports::Stream;
use crate::core::shape::{Build, Ends, Shape};
use crate::{archive_state, params, ports};

params! {
    /// Gives a sound the level differences, the delay and the coherence that a target has between the ears.
    ///
    /// For a sound that was put together from recordings and follows a binaural target: units are chosen once for both ears
    /// (`Mfcc(channels: SharedMid)`), and this node places them at the ears. In about 30 overlapping mel bands each ear gets the
    /// level of the target relative to the mean power of both; the delay is that of the largest cross-correlation within 1 ms, which the
    /// loudest direction determines; and where the ears of the target differ beyond both, as with sources all around, a decorrelated part is mixed
    /// in, which is 11 to 21 ms late. Cues are averages over 64 ms, weighted towards the middle.
    ///
    /// A sound of several channels keeps the delays and the coherence that it has, and gets level differences only: each channel is scaled by
    /// band, at most by 20 dB, and the power of all channels in a band remains. This serves units that are chosen for each channel
    /// (`channels: Independent`). Binaural recordings whose channels are chosen together (`Joint`) have cues of their own, which `levels: false`
    /// leaves unchanged.
    ///
    /// A mono target changes nothing: the sound passes bit for bit, without latency. Otherwise the node reads 53 ms ahead. A target of
    /// more than two channels gives level differences only.
    ///
    /// # Source
    /// Faller and Baumgarte, "Binaural cue coding, part II: schemes and applications" (IEEE Trans. Speech and Audio Processing 11(6),
    /// 2003); Breebaart, van de Par, Kohlrausch and Schuijers, "Parametric coding of stereo audio" (EURASIP JASP 2005:9), section 5.
    pub struct InterauralCuesParams {
        /// Change the level differences of a sound that has several channels.
        levels: bool = true;
    }
}
ports! {
    /// Ports of `InterauralCues`.
    pub struct InterauralCuesPorts / InterauralCuesIo {
        in {
            /// The sound: mono, or with the channels of the target.
            audio: Stream<f32>,
            /// The sound whose cues it gets, of the same rate.
            target: Stream<f32>,
        }
        out {
            /// The sound with the channels of the target.
            out: Stream<f32>,
        }
    }
}

/// The node over [`CueTransfer`]; without one it copies.
#[derive(Debug)]
pub struct InterauralCues {
    transfer: Option<CueTransfer>,
    frames: CueFrames,
    /// Index of the next frame, which begins with the sample of this number times the hop.
    next: Option<i64>,
    /// Interleaved samples from the beginning of the next frame on.
    target: Vec<f32>,
    audio: Vec<f32>,
    /// The latest hop of the output.
    hop: Vec<f32>,
}

/// Returns true if the cues of a target change audio.
fn transfers(p: &InterauralCuesParams, target: Channels, audio: Channels) -> bool {
    target.0 > 1 && (audio.0 == 1 || p.levels)
}

impl Node for InterauralCues {
    type Params = InterauralCuesParams;
    type Ports = InterauralCuesPorts;
    const NAME: &'static str = "InterauralCues";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 150.0;

    fn shape(p: &InterauralCuesParams, s: &mut Shape<'_, '_, InterauralCuesPorts>) -> Result<(), Reject> {
        type Port = InterauralCuesPorts;
        let (audio, target) = (s.input(Port::audio), s.input(Port::target));
        s.check(same_rate("audio", audio.rate, "`target`", target.rate));
        if audio.format.0 > 1 && target.format.0 > 1 && audio.format != target.format {
            let message = format!("`audio` has {} channels, `target` {}", audio.format.0, target.format.0);
            let help =
                "choose units for one channel (Mfcc(channels: SharedMid)), or for each channel of the target";
            s.wrong(Reject::new("F046", message).at("audio").help(help));
        }
        s.when_ended(Port::audio, Ends::Stop);
        let mut channels = audio.format;
        if transfers(p, target.format, audio.format) {
            let ahead = CueFrames::at_rate(audio.rate.as_f64()).look_ahead();
            s.lookaround(Port::audio, 0, ahead);
            s.lookaround(Port::target, 0, ahead);
            channels = target.format;
        }
        s.output(Port::out, audio.rate, channels);
        Ok(())
    }

    fn build(p: &InterauralCuesParams, cx: &Build<'_>) -> Result<Self, Fault> {
        type Port = InterauralCuesPorts;
        let (audio, target) = (cx.input(Port::audio), cx.input(Port::target));
        let (inputs, channels) = (usize::from(audio.format.0), usize::from(target.format.0));
        let rate = audio.rate.as_f64();
        let frames = CueFrames::at_rate(rate);
        let transfer =
            transfers(p, target.format, audio.format).then(|| CueTransfer::new(rate, channels, inputs));
        let buffered = match transfer {
            Some(_) => frames.length + 2 * frames.look_ahead() + cx.items_per_window(audio.rate),
            None => 0,
        };
        Ok(Self {
            hop: vec![0.0; frames.hop * channels],
            target: Vec::with_capacity(buffered * channels),
            audio: Vec::with_capacity(buffered * inputs),
            next: None,
            transfer,
            frames,
        })
    }

    fn run(&mut self, mut io: InterauralCuesIo<'_>) -> Result<(), Fault> {
        let Some(transfer) = &mut self.transfer else {
            io.out.items().copy_from_slice(io.audio.items());
            return Ok(());
        };
        let CueFrames { length, hop } = self.frames;
        let (first, width) = (io.out.first(), io.out.width().max(1));
        let inputs = io.audio.width().max(1);
        let hop_samples = hop as i64;
        let start = first.div_euclid(hop_samples) - self.frames.overlapping() as i64;
        if self.next.is_none() {
            // Silence before the first sample.
            let before = (first - start * hop_samples) as usize;
            self.target.resize(before * width, 0.0);
            self.audio.resize(before * inputs, 0.0);
        }
        let mut next = self.next.unwrap_or(start);
        let buffered = (next * hop_samples + (self.audio.len() / inputs) as i64 - first).max(0) as usize;
        self.target.extend(io.target.around().iter().skip(buffered * width));
        self.audio.extend(io.audio.around().iter().skip(buffered * inputs));
        let mut used = 0;
        let latency = transfer.latency() as i64;
        let mut out = io.out.items();
        let mut at = first;
        while !out.is_empty() {
            let wanted = at.div_euclid(hop_samples);
            while next <= wanted + latency {
                let target = self.target.get(used * width..(used + length) * width).unwrap_or_default();
                let audio = self.audio.get(used * inputs..(used + length) * inputs).unwrap_or_default();
                transfer.next(target, audio, &mut self.hop);
                next += 1;
                used += hop;
            }
            let from = (at - wanted * hop_samples) as usize;
            let count = (hop - from).min(out.len() / width);
            let (now, rest) = std::mem::take(&mut out).split_at_mut(count * width);
            now.copy_from_slice(&self.hop[from * width..(from + count) * width]);
            (at, out) = (at + count as i64, rest);
        }
        self.target.drain(..(used * width).min(self.target.len()));
        self.audio.drain(..(used * inputs).min(self.audio.len()));
        self.next = Some(next);
        Ok(())
    }

    archive_state!(each transfer, next, target, audio, hop);
}

#[cfg(test)]
mod tests;
