//! Standalone runs: windows, padding, look-ahead and events, with test nodes.

use foley_nodes::core::fault::{Fault, Reject};
use foley_nodes::core::item::{Channels, Event};
use foley_nodes::core::node::{Class, Node};
use foley_nodes::core::random::Rng;
use foley_nodes::core::shape::{Build, Ends, Shape};
use foley_nodes::core::standalone::Standalone;
use foley_nodes::core::time::{Rate, TICKS_PER_SECOND, Tick, ticks};
use foley_nodes::{params, ports};
use serde::{Deserialize, Serialize};

params! {
    /// Sums each sample with its neighbours.
    pub struct NeighboursParams {
        /// Items before.
        past: usize = 2, unit "items", range 0..=100;
        /// Items after.
        ahead: usize = 3, unit "items", range 0..=100;
        /// Holds the first and the last item beyond the ends.
        hold: bool = false;
    }
}
ports! {
    pub struct NeighboursPorts / NeighboursIo {
        in {
            /// Any audio.
            audio: foley_nodes::core::ports::Stream<f32>,
        }
        out {
            /// The sums.
            out: foley_nodes::core::ports::Stream<f32>,
        }
    }
}

struct Neighbours;

impl Node for Neighbours {
    type Params = NeighboursParams;
    type Ports = NeighboursPorts;
    const NAME: &'static str = "Neighbours";
    const CLASS: Class = Class::Audio;

    fn shape(p: &NeighboursParams, s: &mut Shape<'_, '_, NeighboursPorts>) -> Result<(), Reject> {
        let audio = s.input(NeighboursPorts::audio);
        s.lookaround(NeighboursPorts::audio, p.past, p.ahead);
        if p.hold {
            s.when_ended(NeighboursPorts::audio, Ends::Hold);
        }
        s.output(NeighboursPorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &NeighboursParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self)
    }

    fn run(&mut self, mut io: NeighboursIo<'_>) -> Result<(), Fault> {
        let width = io.audio.width();
        let around = io.audio.around();
        let neighbours = around.len() / width - io.audio.len();
        for (k, out) in io.out.items().iter_mut().enumerate() {
            let (item, channel) = (k / width, k % width);
            *out = (item..=item + neighbours).map(|i| around[i * width + channel]).sum();
        }
        Ok(())
    }
}

fn run(past: usize, ahead: usize, hold: bool, window: Tick) -> Vec<f32> {
    let data = (0..100).map(|k| (1 + k) as f32).collect();
    let standalone = Standalone::new::<Neighbours>(NeighboursParams { past, ahead, hold })
        .input(NeighboursPorts::audio, Rate::hz(1000), Channels(2), data)
        .window(window);
    standalone.run().unwrap().stream(NeighboursPorts::out)
}

#[test]
fn windows_of_any_length_give_the_same_sums() {
    for hold in [false, true] {
        let expected = run(2, 3, hold, TICKS_PER_SECOND);
        assert_eq!(expected.len(), 100);
        for window in
            [1, 7, 64, 1000].map(|samples| Rate::hz(1000).tick(samples)).into_iter().chain([ticks(0.00037)])
        {
            assert_eq!(run(2, 3, hold, window), expected, "window {window}, hold {hold}");
        }
    }
}

#[test]
fn silence_surrounds_a_stream_unless_it_is_held() {
    assert_eq!(run(1, 1, false, ticks(0.01))[..4], [4.0, 6.0, 9.0, 12.0]);
    assert_eq!(run(1, 1, true, ticks(0.01))[..4], [5.0, 8.0, 9.0, 12.0]);
    assert_eq!(run(1, 1, false, ticks(0.01))[98..], [97.0 + 99.0, 98.0 + 100.0]);
    assert_eq!(run(1, 1, true, ticks(0.01))[98..], [97.0 + 99.0 + 99.0, 98.0 + 100.0 + 100.0]);
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Knock(f32);

impl Event for Knock {
    const NAME: &'static str = "knock";
    fn trial(rng: &mut Rng) -> Self {
        Self(rng.uniform() as f32)
    }
}

params! {
    /// Repeats each knock with a delay.
    pub struct EchoParams {
        /// Delay of the echo.
        after: f64 = 0.01, unit "s", range 0.0..=1.0;
    }
}
ports! {
    pub struct EchoPorts / EchoIo {
        in {
            /// Knocks.
            knocks: foley_nodes::core::ports::Events<Knock>,
        }
        out {
            /// Knocks, and their echoes.
            out: foley_nodes::core::ports::Events<Knock>,
        }
    }
}

struct Echo {
    after: Tick,
}

impl Node for Echo {
    type Params = EchoParams;
    type Ports = EchoPorts;
    const NAME: &'static str = "Echo";
    const CLASS: Class = Class::Audio;

    fn shape(p: &EchoParams, s: &mut Shape<'_, '_, EchoPorts>) -> Result<(), Reject> {
        s.lookaround(EchoPorts::knocks, ticks(p.after) as usize, 0);
        s.tail(ticks(p.after) + 1);
        Ok(())
    }

    fn build(p: &EchoParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { after: ticks(p.after) })
    }

    fn run(&mut self, mut io: EchoIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.out.window();
        for (tick, knock) in io.knocks.events() {
            for (tick, knock) in [(*tick, knock.clone()), (tick + self.after, Knock(knock.0 / 2.0))] {
                if (from..to).contains(&tick) {
                    io.out.push(tick, knock);
                }
            }
        }
        Ok(())
    }
}

#[test]
fn events_keep_their_times_across_windows() {
    let knocks: Vec<(Tick, Knock)> =
        (0..50).map(|k| (Tick::from(k) * ticks(0.0071), Knock(k as f32 + 1.0))).collect();
    let echo = |window| {
        let standalone = Standalone::new::<Echo>(EchoParams { after: 0.05 });
        let run =
            standalone.events(EchoPorts::knocks, knocks.clone(), ticks(0.4)).window(window).run().unwrap();
        run.events(EchoPorts::out)
    };
    let expected = echo(TICKS_PER_SECOND);
    assert_eq!(expected.len(), 100);
    assert!(expected.is_sorted_by_key(|(tick, _)| *tick));
    assert!(expected.contains(&(ticks(0.05), Knock(0.5))));
    for window in [1, 7, 64, 1000].map(|ms| ticks(0.001) * ms) {
        assert_eq!(echo(window), expected, "window {window}");
    }
}

params! {
    /// Passes audio through a delay line of three samples, as a node with an internal pipeline does.
    pub struct PipelineParams {}
}
ports! {
    pub struct PipelinePorts / PipelineIo {
        in {
            /// Any audio.
            audio: foley_nodes::core::ports::Stream<f32>,
        }
        out {
            /// The same audio at the same times: the lag compensates the delay.
            out: foley_nodes::core::ports::Stream<f32>,
        }
    }
}

struct Pipeline([f32; 3]);

const DELAY: i64 = 3;

impl Node for Pipeline {
    type Params = PipelineParams;
    type Ports = PipelinePorts;
    const NAME: &'static str = "Pipeline";
    const CLASS: Class = Class::Audio;

    fn shape(_: &PipelineParams, s: &mut Shape<'_, '_, PipelinePorts>) -> Result<(), Reject> {
        let audio = s.input(PipelinePorts::audio);
        s.lag(audio.rate.tick(DELAY));
        s.when_ended(PipelinePorts::audio, Ends::Stop);
        s.output(PipelinePorts::out, audio.rate, audio.format);
        Ok(())
    }

    fn build(_: &PipelineParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self([0.0; 3]))
    }

    fn run(&mut self, mut io: PipelineIo<'_>) -> Result<(), Fault> {
        let first = io.audio.first();
        let mut out = io.out.items().iter_mut();
        for (item, sample) in (first..).zip(io.audio.items()) {
            let index = (item % DELAY) as usize;
            // The first samples from the line precede the start of the stream.
            if item >= DELAY {
                *out.next().expect("there are as many outputs as inputs") = self.0[index];
            }
            self.0[index] = *sample;
        }
        assert!(out.next().is_none());
        Ok(())
    }
}

#[test]
fn a_node_that_lags_runs_until_its_last_sample_is_output() {
    let samples: Vec<f32> = (1..=20).map(|k| k as f32).collect();
    let rate = Rate::hz(1000);
    for window in [rate.tick(1), rate.tick(7), ticks(0.0037), TICKS_PER_SECOND] {
        let standalone = Standalone::new::<Pipeline>(PipelineParams {})
            .input(PipelinePorts::audio, rate, Channels(1), samples.clone())
            .window(window);
        assert_eq!(standalone.run().unwrap().stream(PipelinePorts::out), samples, "window {window}");
    }
}
