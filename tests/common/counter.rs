//! A node through which events pass from a worker to the callback.

use foley_nodes::dsp::Trigger;
use foley_nodes::prelude::node::*;

params! {
    /// Has no parameters.
    pub struct PlainParams {}
}

ports! {
    pub struct CounterPorts / CounterIo {
        in {
            /// The triggers.
            beats: Events<Trigger>,
        }
        out {
            /// The same, with their numbers as gains.
            counted: Events<Trigger>,
        }
    }
}

/// Numbers triggers from 0 on, on a worker.
pub struct Counter(f32);

impl Node for Counter {
    type Params = PlainParams;
    type Ports = CounterPorts;
    const NAME: &'static str = "Counter";
    const CLASS: Class = Class::Worker;

    fn shape(_: &PlainParams, _: &mut Shape<'_, '_, CounterPorts>) -> Result<(), Reject> {
        Ok(())
    }

    fn build(_: &PlainParams, _: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self(0.0))
    }

    fn run(&mut self, mut io: CounterIo<'_>) -> Result<(), Fault> {
        for (tick, _) in io.beats.events() {
            io.counted.push(*tick, Trigger::of(self.0));
            self.0 += 1.0;
        }
        Ok(())
    }
}
