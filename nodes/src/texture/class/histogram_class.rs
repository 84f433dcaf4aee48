//! The class of a texture, as a value node.

use super::histogram::{Class, TextureClass, classify};
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
    /// The bandwidth is the exponential of the entropy of a histogram of 256 bins, over 256: 0.005 for tiles of two tones, 0.08 for
    /// such tiles with a little noise, 0.26 for grey noise of a standard deviation of 16 of 255. A tap as SVG draws the histogram.
    /// Simple textures sound best by their discontinuity map, complex ones by isophotes or by features and noise.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 2.
    pub struct HistogramClassParams {
        /// Bandwidth below which textures are simple.
        threshold: f32 = 0.2, unit "", range 0.0..=1.0;
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

    fn eval(p: &HistogramClassParams, _: &Build<'_>, mut io: HistogramClassIo<'_>) -> Result<Summary, Fault> {
        let given = match p.class {
            ClassChoice::Auto => None,
            ClassChoice::Simple => Some(Class::Simple),
            ClassChoice::Complex => Some(Class::Complex),
        };
        let class = classify(io.luma, p.threshold, given);
        let name = format!("{:?}", class.class).to_lowercase();
        let summary = vec![("class", name.into()), ("bandwidth", class.bandwidth.into())];
        io.found.set(class);
        Ok(summary)
    }
}
