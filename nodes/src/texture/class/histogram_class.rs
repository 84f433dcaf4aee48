//! The class of a texture, as a value node.

use super::histogram::{Class, TextureClass, classify};
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::maps::Luma;
use crate::{choices, params, ports};

choices! {
    /// How the class is found.
    pub enum ClassChoice {
        /// By the bandwidth of the histogram.
        Auto,
        /// Simple, whatever the histogram says.
        Simple,
        /// Complex, whatever the histogram says.
        Complex,
    }
}

params! {
    /// Whether a texture is simple or complex, by how many tones it is made of.
    ///
    /// The bandwidth is the exponential of the entropy of a histogram of 256 bins, over 256: 0.005 for tiles of two tones, 0.08 with a
    /// little noise on them, 0.26 for a grey of a standard deviation of 16 of 255. A tap as SVG draws the histogram. Simple textures
    /// sound best by their map of discontinuities, complex ones by isophotes or by features and noise.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 2.
    pub struct HistogramClassParams {
        /// Textures of a bandwidth below this are simple.
        threshold: f32 = 0.2, unit "", range 0.0..=1.0;
        /// The class, where it is known better.
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
        let told = match p.class {
            ClassChoice::Auto => None,
            ClassChoice::Simple => Some(Class::Simple),
            ClassChoice::Complex => Some(Class::Complex),
        };
        let class = classify(io.luma, p.threshold, told);
        let name = format!("{:?}", class.class).to_lowercase();
        let summary = vec![("class", name.into()), ("bandwidth", class.bandwidth.into())];
        io.found.set(class);
        Ok(summary)
    }
}
