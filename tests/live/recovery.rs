//! A node whose output is not finite while a graph plays is reset, is reported once, and sounds again.

use foley::Registry;
use foley::graph::{DirFiles, Limits, LoadOptions, load_text};
use foley::live::input::Hub;
use foley::live::{Callback, LiveGraph, Options, Player, PlayerEvent};
use foley::nodes::core::input::{Message, MessageKind};
use foley::nodes::prelude::node::*;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

params! {
    /// Adds up its input, and takes what it adds up by as much again where it is large.
    pub struct UnstableParams {}
}

ports! {
    pub struct UnstablePorts / UnstableIo {
        in {
            /// The numbers.
            audio: Stream<f32>,
        }
        out {
            /// The last number, plus 0 or a number that is not finite.
            sum: Stream<f32>,
        }
    }
}

/// Windows that a node ran late, and in time.
static WINDOWS: [AtomicU64; 2] = [const { AtomicU64::new(0) }; 2];

struct CountsLateWindows {
    late: bool,
}

impl Node for CountsLateWindows {
    type Params = UnstableParams;
    type Ports = UnstablePorts;
    const NAME: &'static str = "CountsLateWindows";
    const CLASS: Class = Class::Worker;

    fn shape(_: &UnstableParams, s: &mut Shape<'_, '_, UnstablePorts>) -> Result<(), Reject> {
        let audio = s.input(UnstablePorts::audio);
        s.output(UnstablePorts::sum, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &UnstableParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { late: false })
    }

    fn run(&mut self, mut io: UnstableIo<'_>) -> Result<(), Fault> {
        WINDOWS[usize::from(!self.late)].fetch_add(1, Relaxed);
        io.sum.items().copy_from_slice(io.audio.items());
        Ok(())
    }

    fn set_late(&mut self, late: bool) {
        self.late = late;
    }
}

#[test]
fn nodes_that_are_behind_learn_that_their_windows_are_late_until_they_have_caught_up() {
    let (mut player, mut callback, _) = play_through("CountsLateWindows");
    let mut block = vec![0.0; 128];
    let depth = player.depth();
    let counts = || [0, 1].map(|k| WINDOWS[k].load(Relaxed));
    assert_eq!(counts(), [0, depth]);
    for _ in 0..10 {
        player.pump();
        callback.fill(&mut block);
    }
    player.pump();
    assert_eq!(counts(), [0, depth + 10]);
    let missed = |player: &Player| player.shared().meter.missed_in_a_row.load(Relaxed);
    (0..depth + 100).for_each(|_| callback.fill(&mut block));
    assert_eq!(missed(&player), 100);
    player.pump();
    // They are late until they are as far ahead as before.
    assert_eq!(counts(), [100 + depth - 1, depth + 11]);
    callback.fill(&mut block);
    assert_eq!(missed(&player), 0);
}

macro_rules! unstable {
    ($name:ident, $text:literal, $class:expr) => {
        struct $name {
            state: f32,
        }

        impl Node for $name {
            type Params = UnstableParams;
            type Ports = UnstablePorts;
            const NAME: &'static str = $text;
            const CLASS: Class = $class;

            fn shape(_: &UnstableParams, s: &mut Shape<'_, '_, UnstablePorts>) -> Result<(), Reject> {
                let audio = s.input(UnstablePorts::audio);
                s.output(UnstablePorts::sum, audio.rate, audio.format);
                Ok(())
            }

            fn build(_: &UnstableParams, _: &Build<'_>) -> Result<Self, Fault> {
                Ok(Self { state: 0.0 })
            }

            fn run(&mut self, mut io: UnstableIo<'_>) -> Result<(), Fault> {
                for (x, y) in io.audio.items().iter().zip(io.sum.items()) {
                    self.state *= 0.5;
                    if *x > 2.0 {
                        self.state = self.state * x + x;
                    }
                    *y = x + 1e-30 * self.state;
                }
                Ok(())
            }
        }
    };
}
unstable!(InCallback, "UnstableInCallback", Class::Audio);
unstable!(OnWorker, "UnstableOnWorker", Class::Worker);

/// A player whose sound is a live control after a node of a type.
fn play_through(name: &str) -> (Player, Callback, Arc<Hub>) {
    let text = format!(
        "#![schema = \"foley:graph/1\"]\nGraph(nodes: {{ \"x\": LiveControl(channel: \"x\", initial: [0.25], glide: 0.0),
        \"bad\": {name}(audio: \"x\"), \"after\": LowPass(audio: \"bad\", cutoff: 9000.0),
        \"out\": WavOut(audio: \"after\", path: \"o.wav\") }})"
    );
    let registry = Registry::standard().with::<InCallback>().with::<OnWorker>().with::<CountsLateWindows>();
    let options = LoadOptions::default().registry(Arc::new(registry));
    let loaded = load_text("test", &text, Path::new("test.ron"), &options);
    let graph = loaded.graph.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics));
    let hub = Arc::new(Hub::new());
    let files = DirFiles::new(loaded.root, Limits::default());
    let live = LiveGraph { seed: 0, graph, files, memo: None, inputs: Arc::clone(&hub) as _ };
    let (player, callback) = Player::start(live, Options { threads: 0, ..Options::default() }).unwrap();
    hub.set_clock(Arc::clone(player.shared()), callback.rate(), callback.quantum(), player.depth());
    (player, callback, hub)
}

#[test]
fn a_node_that_is_not_finite_is_reset_reported_once_and_sounds_again() {
    for name in ["UnstableInCallback", "UnstableOnWorker"] {
        let (mut player, mut callback, hub) = play_through(name);
        let mut block = vec![0.0; 128];
        let mut renewed = Vec::new();
        let mut play = |player: &mut Player, windows: usize| {
            for _ in 0..windows {
                player.pump();
                callback.fill(&mut block);
                assert!(block.iter().all(|x| x.is_finite() && x.abs() < 3e9), "{name}");
                for event in player.tick() {
                    match event {
                        PlayerEvent::Renewed(id) => renewed.push(id),
                        PlayerEvent::Failed(fault) => panic!("{fault:?}"),
                        _ => {}
                    }
                }
            }
            block[127]
        };
        let send =
            |x: f64| hub.deliver("x", Message::new(MessageKind::Control, &[x]).unwrap(), Duration::ZERO);
        assert!((play(&mut player, 200) - 0.25).abs() < 1e-3, "{name}");
        for _ in 0..3 {
            send(1e39);
            play(&mut player, 60);
            send(0.5);
            assert!((play(&mut player, 300) - 0.5).abs() < 1e-3, "{name} is silent");
        }
        assert_eq!(renewed, ["bad"], "{name}");
    }
}
