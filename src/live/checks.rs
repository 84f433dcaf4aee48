//! Properties that hold for any input of a playing graph: bodies of the fuzz targets, also run by tests on damaged input.

use super::input::{Hub, MAX_SETS, Refusal, read_frames, read_line, read_lines, read_packet};
use super::{CEILING, Callback, LiveGraph, Options, Player, PlayerEvent};
use crate::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley_nodes::core::input::{Inbox, Inputs, MAX_COUNT, MessageKind};
use foley_nodes::core::time::Tick;
use rosc::{OscMessage, OscPacket, OscType, encoder::encode};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// Channels that the inputs name.
const CHANNELS: [&str; 3] = ["hits", "ball", "x"];

/// Inboxes of all kinds on each channel.
fn open_all(hub: &Hub) -> Vec<Box<dyn Inbox>> {
    let kinds = CHANNELS.iter().flat_map(|channel| MessageKind::ALL.map(|kind| (channel, kind)));
    kinds.filter_map(|(channel, kind)| hub.open(channel, kind, MAX_COUNT)).collect()
}

/// A packet, of OSC or not, is counted, and a node reads no more than what counts as delivered.
pub fn check_packet(bytes: &[u8]) {
    let hub = Hub::new();
    let inboxes = open_all(&hub);
    read_packet(bytes, &hub);
    check_delivered(&hub, inboxes.into_iter());
}

/// Each line that cannot be read is counted and reported, and a node reads no more than what counts as delivered.
pub fn check_lines(bytes: &[u8]) {
    let hub = Hub::new();
    let inboxes = open_all(&hub);
    // A time of a log is waited for, and here nothing plays.
    let bytes = String::from_utf8_lossy(bytes).replace("time_s", "time");
    let mut reports = 0_u64;
    read_lines(bytes.as_bytes(), &hub, |_, message| {
        assert!(!message.is_empty());
        reports += 1;
    });
    assert_eq!(reports, hub.refusals.count(Refusal::Malformed));
    check_delivered(&hub, inboxes.into_iter());
}

fn check_delivered(hub: &Hub, inboxes: impl Iterator<Item = Box<dyn Inbox>>) {
    let sets = hub.take_sets(Duration::ZERO).len();
    let mut read = 0;
    for mut inbox in inboxes {
        for window in (0..).map(|window| Tick::MAX / 2 + window) {
            let before = read;
            while let Some((_, message)) = inbox.next(window) {
                assert!(message.numbers().iter().all(|x| x.is_finite()));
                read += 1;
            }
            assert!(read - before <= 1024, "a window is bounded");
            if read == before {
                break;
            }
        }
    }
    assert!(sets <= MAX_SETS && (read + sets) as u64 <= hub.delivered.load(Relaxed));
}

/// A connection that sends meshes is refused and counted, or its frames are positions that a mesh can have.
pub fn check_frames(bytes: &[u8]) {
    let hub = Hub::new();
    let Some(mut inbox) = hub.open_frames("sheet", 6) else { return };
    let read = read_frames(bytes, &hub, &AtomicBool::new(false));
    let counted = hub.refusals.count(Refusal::Malformed) + hub.refusals.count(Refusal::Unclaimed);
    assert!(read.is_ok() || counted > 0);
    let mut shown = [0.0; 6];
    inbox.latest(Tick::MAX, &mut shown);
    assert!(shown.iter().all(|x| x.abs() <= 1e9));
}

/// Filters with a state, all of which a control drives.
const FILTERS: &str = "#![schema = \"foley:graph/1\"]
Graph(nodes: {
    \"x\": LiveControl(channel: \"x\", initial: [0.5], glide: 0.001),
    \"low\": LowPass(audio: \"x\", cutoff: 2000.0),
    \"high\": HighPass(audio: \"low\", cutoff: 1000.0),
    \"loop\": Feedback(audio: \"sum\", like: \"x\", delay: 0.003, gain: 0.1),
    \"sum\": Mix(inputs: [\"low\", \"high\", \"loop\"]),
    \"late\": Delay(audio: \"sum\", seconds: 0.002),
    \"out\": WavOut(audio: \"late\", path: \"o.wav\"),
})";

/// A graph that plays under any control.
pub struct ControlCheck {
    hub: Arc<Hub>,
    player: Player,
    callback: Callback,
    block: Vec<f32>,
}

impl ControlCheck {
    /// Starts to play; `None` if the graph is wrong.
    #[must_use]
    pub fn new() -> Option<Self> {
        let loaded = load_text("filters", FILTERS, Path::new("filters.ron"), &LoadOptions::default());
        let (graph, hub) = (loaded.graph?, Arc::new(Hub::new()));
        let files = DirFiles::new(loaded.root, Limits::default());
        let live = LiveGraph { seed: 0, graph, files, memo: None, inputs: Arc::clone(&hub) as _ };
        let options = Options { threads: 0, ..Options::default() };
        let (player, callback) = Player::start(live, options).ok()?;
        hub.set_clock(Arc::clone(player.shared()), callback.rate(), callback.quantum(), player.depth());
        let block = vec![0.0; callback.quantum()];
        Some(Self { hub, player, callback, block })
    }

    /// Plays windows, and returns the last sample.
    fn play(&mut self, windows: usize) -> f32 {
        for _ in 0..windows {
            self.player.pump();
            self.callback.fill(&mut self.block);
            assert!(self.block.iter().all(|x| x.abs() <= CEILING), "the device gets what it can play");
            let failed = |event: &PlayerEvent| matches!(event, PlayerEvent::Failed(_));
            assert!(!self.player.tick().iter().any(failed), "no number fails a node");
        }
        self.block.last().copied().unwrap_or(0.0)
    }

    /// Sends numbers, 8 bytes each, to the control, by OSC and as lines, and then plays as it did before.
    pub fn check(&mut self, bytes: &[u8]) {
        for (k, number) in bytes.as_chunks::<8>().0.iter().take(8).enumerate() {
            let number = f64::from_le_bytes(*number);
            if k % 2 == 0 {
                let message = |x| OscMessage { addr: "/foley/control/x".into(), args: vec![x] };
                let float = if k % 4 == 0 { OscType::Double(number) } else { OscType::Float(number as f32) };
                read_packet(&encode(&OscPacket::Message(message(float))).unwrap_or_default(), &self.hub);
            } else {
                let line = format!("{{\"control\": \"x\", \"values\": [{number:?}]}}");
                let _ = read_line(&line, &self.hub, &mut Default::default());
            }
            self.play(1);
        }
        let _ = read_line("{\"control\": \"x\", \"values\": [0.5]}", &self.hub, &mut Default::default());
        let last = self.play(60);
        assert!((last - 0.5 / 0.9).abs() < 0.05, "{last}: it is silenced or stuck");
    }
}

/// Seeds of damaged input: `count` of them, and more until `FOLEY_FUZZ_SECONDS` have passed.
#[cfg(test)]
pub(in crate::live) fn seeds(count: u64) -> impl Iterator<Item = u64> {
    let seconds = std::env::var("FOLEY_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok());
    let end = std::time::Instant::now() + Duration::from_secs(seconds.unwrap_or(0));
    (0..).take_while(move |seed| *seed < count || std::time::Instant::now() < end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::random::Rng;

    #[test]
    fn damaged_numbers_of_a_control_silence_nothing_that_follows() {
        let mut check = ControlCheck::new().unwrap();
        let extremes =
            [f64::MAX, f64::MIN, 1e39, -1e39, f64::INFINITY, f64::NAN, 1e9, -1e9, 5e-324, 1e-40, 0.0];
        for seed in seeds(2000) {
            let mut rng = Rng::new(seed);
            let number = |rng: &mut Rng| match rng.below(4) {
                0 => f64::from_bits((rng.below(1 << 32) as u64) << 32 | rng.below(1 << 32) as u64),
                _ => extremes[rng.below(extremes.len())],
            };
            let bytes: Vec<u8> = (0..8).flat_map(|_| number(&mut rng).to_le_bytes()).collect();
            check.check(&bytes);
        }
    }
}
