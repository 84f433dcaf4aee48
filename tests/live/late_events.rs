//! Events of windows that come too late from a worker arrive later, once and in their order.

use crate::common::counter::{Counter, PlainParams};
use foley::Registry;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::live::{Callback, LiveGraph, Options, Player};
use foley::nodes::core::input::NoInputs;
use foley::nodes::core::item::Channels;
use foley::nodes::dsp::Trigger;
use foley::nodes::prelude::node::*;
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

const RATE: Rate = Rate::hz(48_000);

ports! {
    pub struct ListPorts / ListIo {
        in {
            /// The triggers.
            beats: Events<Trigger>,
        }
        out {
            /// Silence.
            audio: Stream<f32>,
        }
    }
}

/// Times and gains of the triggers that have arrived.
static ARRIVED: Mutex<Vec<(Tick, f32)>> = Mutex::new(Vec::new());

/// Lists triggers, in the callback.
struct List;

impl Node for List {
    type Params = PlainParams;
    type Ports = ListPorts;
    const NAME: &'static str = "List";
    const CLASS: Class = Class::Audio;

    fn shape(_: &PlainParams, s: &mut Shape<'_, '_, ListPorts>) -> Result<(), Reject> {
        s.output(ListPorts::audio, RATE, Channels(1));
        Ok(())
    }

    fn build(_: &PlainParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self)
    }

    fn run(&mut self, mut io: ListIo<'_>) -> Result<(), Fault> {
        ARRIVED.lock().unwrap().extend(io.beats.events().iter().map(|(tick, t)| (*tick, t.gain)));
        io.audio.items().fill(0.0);
        Ok(())
    }
}

/// Frames of a window.
const QUANTUM: usize = 96;

/// A player of two triggers a window, which pass through a worker.
fn play() -> (Player, Callback) {
    let text = "#![schema = \"foley:graph/1\"]\nGraph(nodes: { \"m\": Metronome(interval: 0.001), \
                \"counted\": Counter(beats: \"m\"), \"list\": List(beats: \"counted\"), \
                \"out\": WavOut(audio: \"list\", path: \"o.wav\") })";
    let registry = Registry::standard().with::<Counter>().with::<List>();
    let options = LoadOptions::default().registry(Arc::new(registry));
    let loaded = load_text("test", text, Path::new("test.ron"), &options);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics));
    let files = DirFiles::new(loaded.root, Limits::default());
    let live = LiveGraph { seed: 0, graph, files, memo: None, inputs: Arc::new(NoInputs) };
    let options = Options { threads: 0, quantum: QUANTUM, ahead: 0.01, ..Options::default() };
    Player::start(live, options).unwrap()
}

#[test]
fn events_of_missed_windows_arrive_once_in_order_with_the_next_window() {
    let (mut player, mut callback) = play();
    let mut block = [0.0; QUANTUM];
    let mut played = 0;
    let mut fill = |windows: u64| {
        (0..windows).for_each(|_| callback.fill(&mut block));
        played += windows;
        RATE.tick(played as i64 * QUANTUM as i64)
    };
    let depth = player.depth();
    // The worker stands still for 20 windows, then for so many that their events are more than fit.
    player.pump();
    let gaps = [20, 1000].map(|missed| {
        let before = fill(depth);
        let after = fill(missed);
        player.pump();
        fill(1);
        for _ in 0..20 {
            player.pump();
            fill(1);
        }
        player.pump();
        (before, after)
    });
    let arrived = ARRIVED.lock().unwrap();
    let meter = &player.shared().meter;
    let (lost, last) = (meter.lost_events.load(Relaxed), arrived.last().unwrap().1);
    assert_eq!(meter.missed.load(Relaxed), 1020);
    assert!(arrived.is_sorted_by(|a, b| a.0 <= b.0 && a.1 < b.1), "{arrived:?}");
    assert_eq!(arrived.len() as u64 + lost, last as u64 + 1);
    assert!((1..2000).contains(&lost), "{lost}");
    for (k, (before, after)) in gaps.into_iter().enumerate() {
        let late = arrived.iter().filter(|(tick, _)| *tick == after).count();
        assert!(arrived.iter().all(|(tick, _)| !(before..after).contains(tick)), "gap {k}");
        // Those of the gap, and the first of the window itself.
        assert!(if k == 0 { late == 41 } else { late > 500 }, "gap {k}: {late}");
    }
}
