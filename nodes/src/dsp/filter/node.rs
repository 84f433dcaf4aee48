//! The ports of every filter, and the node around a Butterworth filter.

use crate::core::ports::Stream;
use crate::ports;
ports! {
    /// Ports of all filters.
    pub struct FilterPorts / FilterIo {
        in {
            /// Audio with any number of channels.
            audio: Stream<f32>,
        }
        out {
            /// The filtered audio.
            out: Stream<f32>,
        }
    }
}
macro_rules! butterworth_node {
    ($(#[$doc:meta])* $node:ident, $params:ident, $name:literal, $band:expr) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $node {
            filter: Cascade,
            rate: f64,
        }

        impl $node {
            fn design(p: &$params, rate: f64) -> Result<Butterworth, Reject> {
                Butterworth::design($band, p.order, p.cutoff, rate).map_err(|e| Reject::from(e).at("cutoff"))
            }
        }

        impl Node for $node {
            type Params = $params;
            type Ports = FilterPorts;
            const NAME: &'static str = $name;
            const CLASS: Class = Class::Audio;
            const COST: f64 = 8.0;
            const TAKES_BLOCKS: bool = true;

            fn shape(p: &$params, s: &mut Shape<'_, '_, FilterPorts>) -> Result<(), Reject> {
                let audio = s.input(FilterPorts::audio);
                Self::design(p, audio.rate.as_f64())?;
                s.output(FilterPorts::out, audio.rate, audio.format);
                Ok(())
            }

            fn build(p: &$params, cx: &Build<'_>) -> Result<Self, Fault> {
                let audio = cx.input(FilterPorts::audio);
                let rate = audio.rate.as_f64();
                Ok(Self { filter: Cascade::new(&Self::design(p, rate)?, audio.format.0.into()), rate })
            }

            fn run(&mut self, mut io: FilterIo<'_>) -> Result<(), Fault> {
                self.process_block(io.audio.items(), io.out.items());
                Ok(())
            }

            fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
                out.copy_from_slice(input);
                self.filter.process(out);
            }

            fn retune(&mut self, new: &$params) -> Retune {
                match Self::design(new, self.rate) {
                    Ok(design) if self.filter.set_design(&design) => Retune::Done,
                    _ => Retune::Rebuild,
                }
            }

            fn adopt(&mut self, old: &mut Self) {
                self.filter.take_state(&mut old.filter);
            }

            archive_state!(filter);
        }
    };
}
pub(super) use butterworth_node;
