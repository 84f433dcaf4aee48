//! The node `TemporalGaussian`.

use super::item::Features;
use super::params::check_widths;
use super::temporal_filter::TemporalFilter;
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::ports::Stream;
use crate::core::random::Rng;
use crate::core::shape::{Build, Ends, Shape};
use crate::{params, ports};

params! {
    /// Smooths features over time by a Gaussian with a separate width for each coefficient.
    ///
    /// The standard deviation is a quarter of the width; the kernel is truncated at half the width. Beyond the ends of the stream the
    /// first and the last item are repeated. The database to compare with must have the same widths.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.2; the causal
    /// filter is an addition, for live use.
    pub struct TemporalGaussianParams {
        /// Width for each coefficient, or one for all; a width of up to 1 leaves a coefficient unchanged.
        widths: Vec<f64> = vec![20.0, 50.0, 10.0], unit "units", range 0.0..=10_000.0;
        /// Uses no look-ahead: the planner adds no delay, but features lag by a fifth of the width.
        causal: bool = false;
    }
}

ports! {
    pub struct TemporalGaussianPorts / TemporalGaussianIo {
        in {
            /// Features before smoothing.
            features: Stream<Features>,
        }
        out {
            /// Smoothed features.
            smooth: Stream<Features>,
        }
    }
}

/// The node `TemporalGaussian`.
#[derive(Debug)]
pub struct TemporalGaussian {
    filter: TemporalFilter,
    vectors: usize,
}

impl Node for TemporalGaussian {
    type Params = TemporalGaussianParams;
    type Ports = TemporalGaussianPorts;
    const NAME: &'static str = "TemporalGaussian";
    const CLASS: Class = Class::Audio;
    const COST: f64 = 50.0;

    fn shape(p: &TemporalGaussianParams, s: &mut Shape<'_, '_, TemporalGaussianPorts>) -> Result<(), Reject> {
        let features = s.input(TemporalGaussianPorts::features);
        let mut c = (*features.format.conventions).clone();
        check_widths(&p.widths, c.n as usize)?;
        if !c.widths.is_empty() {
            let message = "these features are already smoothed by a Gaussian";
            s.wrong(Reject::new("F051", message).at("features").help("use only one TemporalGaussian"));
        }
        (c.widths, c.causal) = (p.widths.clone(), p.causal);
        let filter = filter(&c);
        s.lookaround(TemporalGaussianPorts::features, filter.look_behind(), filter.look_ahead());
        s.when_ended(TemporalGaussianPorts::features, Ends::Hold);
        s.ends(features.end);
        s.output(TemporalGaussianPorts::smooth, features.rate, features.format.with(c));
        Ok(())
    }

    fn build(_: &TemporalGaussianParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let format = cx.output(TemporalGaussianPorts::smooth).format;
        Ok(Self { filter: filter(&format.conventions), vectors: format.vectors })
    }

    fn run(&mut self, mut io: TemporalGaussianIo<'_>) -> Result<(), Fault> {
        self.filter.process(io.features.around(), self.vectors, io.smooth.items());
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (TemporalGaussianParams, MemoryFiles) {
        let widths = (0..[0, 1, 3][rng.below(3)]).map(|_| rng.between(0.0, 9.0)).collect();
        (TemporalGaussianParams { widths, causal: rng.below(2) == 0 }, MemoryFiles::default())
    }
}

fn filter(c: &super::FeatureConventions) -> TemporalFilter {
    TemporalFilter::new(&(0..c.dims()).map(|dim| c.width(dim)).collect::<Vec<_>>(), c.causal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::standalone::Standalone;
    use crate::core::time::Rate;
    use crate::feature::{FeatureConventions, FeatureFormat};
    use std::sync::Arc;

    fn standalone(widths: &[f64], conventions: FeatureConventions) -> Standalone {
        let format = FeatureFormat { vectors: 1, conventions: Arc::new(conventions) };
        let features = (0..90).map(|i| (i % 7) as f32).collect();
        Standalone::new::<TemporalGaussian>(TemporalGaussianParams { widths: widths.to_vec(), causal: false })
            .input(TemporalGaussianPorts::features, Rate::hz(240), format, features)
    }

    #[test]
    fn a_stream_is_smoothed_like_a_segment() {
        let features: Vec<f32> = (0..90).map(|i| (i % 7) as f32).collect();
        let run = standalone(&[5.0, 8.0, 0.0], FeatureConventions::trial()).run().unwrap();
        let expected = TemporalFilter::new(&[5.0, 8.0, 0.0], false).process_segment(&features);
        assert_eq!(run.stream(TemporalGaussianPorts::smooth), expected);
    }

    #[test]
    fn widths_that_do_not_fit_and_a_second_gaussian_are_refused() {
        let refused = |widths: &[f64], c| standalone(widths, c).shape().unwrap_err().field;
        assert_eq!(refused(&[1.0, 2.0], FeatureConventions::trial()).as_deref(), Some("widths"));
        let smooth = FeatureConventions { widths: vec![4.0], ..FeatureConventions::trial() };
        assert_eq!(refused(&[4.0], smooth).as_deref(), Some("features"));
    }
}
