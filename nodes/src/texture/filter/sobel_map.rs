//! The Sobel gradient of a texture, as a value node.

use super::kernel::Kernel;
use super::separable::smooth;
use super::sobel::gradient;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::maps::{DiscontinuityMap, Luma};
use crate::{params, ports};

params! {
    /// The gradient of the luminance of a surface by the Sobel operator, in luminance per pixel.
    ///
    /// A step of luminance is two to three pixels wide in the map; a thin line appears as a pair of opposite signs. The
    /// density of the image limits the sharpness of edges: there are no frequencies above half the density times the
    /// speed. A tap as SVG draws the map.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.1 and figure 3.
    pub struct SobelMapParams {
        /// Standard deviation of a Gaussian before the operator, for grainy images.
        pre_blur: f64 = 0.0, unit "px", range 0.0..=20.0;
    }
}

ports! {
    pub struct SobelMapPorts / SobelMapIo {
        in {
            /// The luminance.
            luma: Value<Luma>,
        }
        out {
            /// The gradient.
            map: Value<DiscontinuityMap>,
        }
    }
}

/// The node over [`gradient`].
#[derive(Debug)]
pub struct SobelMap;

impl Func for SobelMap {
    type Params = SobelMapParams;
    type Ports = SobelMapPorts;
    const NAME: &'static str = "SobelMap";

    fn eval(p: &SobelMapParams, _: &Build<'_>, mut io: SobelMapIo<'_>) -> Result<Summary, Fault> {
        let surface = io.luma.surface;
        let soft = smooth(&io.luma.grid, &Kernel::gaussian(p.pre_blur, 4.0), surface.wrap);
        let [gx, gy] = gradient(&soft, surface.wrap);
        let pairs = gx.samples.iter().zip(&gy.samples);
        let greatest = pairs.fold(0.0_f32, |max, (x, y)| max.max(x * x + y * y)).sqrt();
        io.map.set(DiscontinuityMap { gx, gy, surface });
        Ok(vec![("greatest_per_pixel", greatest.into())])
    }
}
