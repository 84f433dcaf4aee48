//! The drawings of one texture beside each other, as a value node.

use super::panels::TextureDrawing;
use crate::core::fault::Fault;
use crate::core::item::Data;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::texture::class::histogram::TextureClass;
use crate::texture::isophote::curves::Isophotes;
use crate::texture::maps::{DiscontinuityMap, FeatureMap, Luma, NoiseMap};
use crate::{params, ports};

params! {
    /// Draws an image and the maps made of it beside each other: `--tap NODE=figure.svg`.
    ///
    /// The panels are those of the linked inputs, in their order. `class` beside the image is figure 2 of the paper, `curves` and `map`
    /// beside it are figure 4, `features` and `noise` beside it figure 5.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), figures 2 to 5.
    pub struct TextureFigureParams {}
}
ports! {
    pub struct TextureFigurePorts / TextureFigureIo {
        in {
            /// The image.
            luma: Value<Luma>,
            /// Its histogram.
            class: Option<Value<TextureClass>>,
            /// Its isophotes.
            curves: Option<Value<Isophotes>>,
            /// Its discontinuity map.
            map: Option<Value<DiscontinuityMap>>,
            /// Its main features.
            features: Option<Value<FeatureMap>>,
            /// Its noise.
            noise: Option<Value<NoiseMap>>,
        }
        out {
            /// The panels.
            figure: Value<TextureDrawing>,
        }
    }
}

/// The node over [`TextureDrawing`].
#[derive(Debug)]
pub struct TextureFigure;

impl Func for TextureFigure {
    type Params = TextureFigureParams;
    type Ports = TextureFigurePorts;
    const NAME: &'static str = "TextureFigure";

    fn eval(_: &TextureFigureParams, _: &Build<'_>, mut io: TextureFigureIo<'_>) -> Result<Summary, Fault> {
        let drawings = [
            ("image", io.luma.plot()),
            ("histogram", io.class.and_then(Data::plot)),
            ("isophotes", io.curves.and_then(Data::plot)),
            ("discontinuity map by the Sobel filter", io.map.and_then(Data::plot)),
            ("main features", io.features.and_then(Data::plot)),
            ("noise", io.noise.and_then(Data::plot)),
        ];
        let panels: Vec<_> =
            drawings.into_iter().filter_map(|(name, svg)| Some((name.to_owned(), svg?))).collect();
        let count = panels.len();
        io.figure.set(TextureDrawing { panels });
        Ok(vec![("panels", count.into())])
    }
}
