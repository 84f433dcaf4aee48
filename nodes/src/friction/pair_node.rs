//! The friction model of two materials as a value node.

use super::builder_node::told;
use super::model::FrictionModel;
use super::pair::inferred_pair;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::{params, ports};

params! {
    /// The friction model of two materials on each other where only that of each on itself was recorded.
    ///
    /// At each speed the spectrum lies half-way between the two, every quantile of it at the mean of its two frequencies,
    /// and its power is the geometric mean. That is a guess, and the model says so (`origin: Inferred`): a recording of
    /// the pair is better.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), with the interpolation of their section 2.
    pub struct PairFrictionModelParams {}
}

ports! {
    pub struct PairFrictionModelPorts / PairFrictionModelIo {
        in {
            /// The one material on itself.
            first: Value<FrictionModel>,
            /// The other on itself.
            second: Value<FrictionModel>,
        }
        out {
            /// The one on the other.
            model: Value<FrictionModel>,
        }
    }
}

/// The node over [`inferred_pair`].
#[derive(Debug)]
pub struct PairFrictionModel;

impl Func for PairFrictionModel {
    type Params = PairFrictionModelParams;
    type Ports = PairFrictionModelPorts;
    const NAME: &'static str = "PairFrictionModel";
    const VERSION: u32 = 2;

    fn eval(
        _: &PairFrictionModelParams,
        _: &Build<'_>,
        mut io: PairFrictionModelIo<'_>,
    ) -> Result<Summary, Fault> {
        let model = inferred_pair(io.first, io.second).map_err(|e| Fault::new("F076", e.to_string()))?;
        let summary = told(&model);
        io.model.set(model);
        Ok(summary)
    }
}
