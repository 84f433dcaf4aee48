//! The node `TextureModel`.

use super::model::{TextureModel, ThresholdRules, ThresholdScale};
use super::tree::WaveletTree;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::{params, ports};

params! {
    /// Makes the statistical model of a sound texture from its wavelet tree.
    ///
    /// Nodes are similar if their coefficients differ by less than a threshold. A small threshold makes the output follow the recordings, a large
    /// one makes it random.
    ///
    /// # Source
    /// Cardle, Brooks, Bar-Joseph and Robinson, "Sound-by-Numbers" (SCA 2003), section 3.
    pub struct TextureModelParams {
        /// Share of the coefficients, by magnitude, below half of the threshold.
        quantile: f64 = 0.002, unit "", range 0.0..=1.0;
        /// The threshold itself, in place of the quantile.
        threshold: Option<f64> = None, unit "", range 0.0..=1.0e9_f64;
        /// Coefficients that the quantile is taken of.
        scale: ThresholdScale = ThresholdScale::Global;
    }
}
ports! {
    pub struct TextureModelPorts / TextureModelIo {
        in {
            /// The tree.
            tree: Value<WaveletTree>,
        }
        out {
            /// The model.
            model: Value<TextureModel>,
        }
    }
}

/// The node over [`TextureModel`].
#[derive(Debug)]
pub struct TextureModelNode;

impl Func for TextureModelNode {
    type Params = TextureModelParams;
    type Ports = TextureModelPorts;
    const NAME: &'static str = "TextureModel";

    fn eval(p: &TextureModelParams, _: &Build<'_>, mut io: TextureModelIo<'_>) -> Result<Summary, Fault> {
        io.tree.validate().map_err(|e| Fault::new("F155", e.to_string()).at("tree"))?;
        let rules = ThresholdRules { quantile: p.quantile, threshold: p.threshold, scale: p.scale };
        let model = TextureModel::new(io.tree.clone(), &rules);
        let summary = model.figures();
        io.model.set(model);
        Ok(summary)
    }
}
