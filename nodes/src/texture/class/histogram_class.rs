//! The class of a texture, as a value node.

use super::histogram::{Class, THRESHOLD, TextureClass, classify, classify_unstretched};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::maps::Luma;
use crate::{choices, params, ports};

choices! {
    /// Choice of the class.
    pub enum ClassChoice {
        /// By the bandwidth of the histogram.
        Auto,
        /// Always simple.
        Simple,
        /// Always complex.
        Complex,
    }
}

params! {
    /// Classifies a texture as simple or complex, by the number of its tones.
    ///
    /// The bandwidth is the exponential of the entropy of a histogram of 256 bins, over 256. The bins cover the percentiles 1 to 99 of
    /// the luminance, so an image has the same bandwidth at any contrast: 0.005 for tiles of two tones, 0.13 for such tiles with noise
    /// of 3 % of their difference, 0.82 for noise of a normal distribution, 1 for equally many pixels of each tone. Tones on less than
    /// 1 % of the pixels do not count: fine joints between noisy tiles are missed. `stretch: false` covers all tones from black to
    /// white, as the paper's histograms do: the bandwidth is then proportional to the contrast, and a threshold of 0.2 fits.
    /// A tap as SVG draws the image and the histogram.
    /// Simple textures sound best by their discontinuity map, complex ones by isophotes or by features and noise.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 2, who state no measure: entropy, range and threshold are choices.
    pub struct HistogramClassParams {
        /// Bandwidth below which textures are simple.
        threshold: f32 = THRESHOLD, unit "", range 0.0..=1.0;
        /// True for bins between the percentiles 1 and 99, false for bins from black to white.
        stretch: bool = true;
        /// The class, or `Auto` to compute it.
        class: ClassChoice = ClassChoice::Auto;
    }
}

ports! {
    pub struct HistogramClassPorts / HistogramClassIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
        }
        out {
            /// The class, the bandwidth and the histogram.
            found: Value<TextureClass>,
        }
    }
}

/// The node over [`classify`].
#[derive(Debug)]
pub struct HistogramClass;

impl Func for HistogramClass {
    type Params = HistogramClassParams;
    type Ports = HistogramClassPorts;
    const NAME: &'static str = "HistogramClass";
    const VERSION: u32 = 2;

    fn eval(p: &HistogramClassParams, _: &Build<'_>, mut io: HistogramClassIo<'_>) -> Result<Summary, Fault> {
        let given = match p.class {
            ClassChoice::Auto => None,
            ClassChoice::Simple => Some(Class::Simple),
            ClassChoice::Complex => Some(Class::Complex),
        };
        let by = if p.stretch { classify } else { classify_unstretched };
        let class = by(io.luma, p.threshold, given);
        let name = format!("{:?}", class.class).to_lowercase();
        let summary = vec![("class", name.into()), ("bandwidth", class.bandwidth.into())];
        io.found.set(class);
        Ok(summary)
    }
}
