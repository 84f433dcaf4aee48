//! Fitting a warp, as a node.

use super::report::Stiffness;
use super::warp::{WARP_VERSION, Warp, WarpMap};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Ends, Shape};
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::warp::correspondence::target_features::{TargetFeatures, checked};
use crate::warp::correspondence::{CorrespondenceSet, Pairing};
use crate::warp::spline::Pair;
use crate::{archive_state, choices, params, ports};

choices! { @param Pairing {
    /// The first unit with the first and so on, as in the paper; the longer side loses its end.
    InOrder,
    /// One pair of the means of both sides.
    Centroid,
    /// Along the cheapest path through both (dynamic time warping), for gestures of different speed.
    Dtw,
} }

params! {
    /// Fits the warp from the features of a target to those of a database, through marked correspondences.
    ///
    /// The spline is the smoothest that comes near all pairs; `lambda` weighs smoothness against nearness, in squared units of the
    /// features: 0 passes through every pair, 1e5 is almost a shift, turn and stretch, and None takes the one of least generalised
    /// cross-validation. The paper's cotton has 1e2, its polyester and windbreaker 1e5, its corduroy 0.
    ///
    /// Features of several channels are fitted by one warp, from the correspondences of all channels: equal features have equal units,
    /// whichever the channel. A correspondence that is marked in one channel serves all. One of all channels with a recording of one channel leads
    /// all of them to the same moment, which reduces the level differences between them: `InterauralCues` restores these. `per_channel` fits
    /// each channel from its own correspondences.
    ///
    /// The summary states the degrees of freedom (between the dimensions plus one and the number of nodes), the residual at the
    /// nodes, the share of the target where the warp folds over, `mirrored` if it mirrors most of the target (common with few
    /// correspondences; a mirror alone folds nothing), and the share outside of twice the radius of the nodes, where the warp
    /// extrapolates. A tap of `warp` as SVG plots the features before and after. Without correspondences the warp is the
    /// identity. Correspondences that do not fit are errors, before the run if the database is known by then. A warning names a
    /// file that was marked in another target or in other recordings.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 4.3, eqs. 7 and 8; Wahba,
    /// "Spline Models for Observational Data" (1990); Belongie, Malik and Puzicha (IEEE PAMI 24(4), 2002), eq. 10, for lambda.
    pub struct TpsFitParams {
        /// Stiffness; None finds one.
        lambda: Option<f64> = None, unit "", range 0.0..=1e12;
        /// Measure `lambda` in units of the squared mean distance of nodes, so that it is independent of the scale of the features.
        scale_free: bool = false;
        /// Pairing of the units of both sides.
        pairing: Pairing = Pairing::InOrder;
        /// Fit one warp for each channel, from the correspondences of that channel.
        per_channel: bool = false;
    }
}
ports! {
    pub struct TpsFitPorts / TpsFitIo {
        in {
            /// Features of the target, filtered as those of the database.
            features: Stream<Features>,
            /// The database.
            database: Value<UnitDatabase>,
            /// The correspondences.
            pairs: Value<CorrespondenceSet>,
        }
        out {
            /// The warp, once the target has ended.
            warp: Fold<Warp>,
        }
    }
}

/// The node over [`WarpMap::fit`].
#[derive(Debug)]
pub struct TpsFit {
    target: TargetFeatures,
    params: TpsFitParams,
}

impl Node for TpsFit {
    type Params = TpsFitParams;
    type Ports = TpsFitPorts;
    const NAME: &'static str = "TpsFit";
    const VERSION: u32 = 9;
    const CLASS: Class = Class::Offline;

    fn shape(_: &TpsFitParams, s: &mut Shape<'_, '_, TpsFitPorts>) -> Result<(), Reject> {
        checked(
            &s.input(TpsFitPorts::features),
            s.value(TpsFitPorts::database),
            s.value(TpsFitPorts::pairs),
        )?;
        s.when_ended(TpsFitPorts::features, Ends::Stop);
        Ok(())
    }

    fn build(p: &TpsFitParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let features = cx.input(TpsFitPorts::features);
        let target =
            TargetFeatures::new(features, cx.value(TpsFitPorts::database), cx.value(TpsFitPorts::pairs))?;
        Ok(Self { target, params: p.clone() })
    }

    fn run(&mut self, io: TpsFitIo<'_>) -> Result<(), Fault> {
        self.target.add(io.features.items());
        Ok(())
    }

    fn finish(&mut self, mut io: TpsFitIo<'_>) -> Result<Summary, Fault> {
        let warp = self.warp()?;
        let mut summary = warp.summary();
        summary.extend(self.target.mismatch_warnings());
        io.warp.set(warp);
        Ok(summary)
    }

    archive_state!(target);
}

impl TpsFit {
    fn warp(&self) -> Result<Warp, Fault> {
        let (target, d) = (&self.target, self.target.format.dims());
        let stiffness = Stiffness::of(self.params.lambda, self.params.scale_free);
        let recorded = &target.database.features[..target.database.recorded() * d];
        let map = |(vector, pairs): (usize, Vec<_>)| {
            let pairs: Vec<Pair> = pairs.into_iter().map(|(_, pair)| pair).collect();
            let own = self.params.per_channel.then(|| target.vector(vector));
            let features = own.as_ref().unwrap_or(&target.features);
            WarpMap::fit(&pairs, d, stiffness, features, recorded)
                .map_err(|e| Fault::new("F111", e.to_string()).at("pairs"))
        };
        Ok(Warp {
            version: WARP_VERSION,
            conventions: target.database.conventions.clone(),
            maps: target
                .pairs(self.params.pairing, self.params.per_channel)?
                .into_iter()
                .enumerate()
                .map(map)
                .collect::<Result<_, _>>()?,
            correspondences: target.pairs.file.clone(),
            recordings: target.database.sources.iter().map(|s| s.provenance.clone()).collect(),
            contents: target.database.sources.iter().map(|s| s.content.clone()).collect(),
            correspondences_content: target.pairs.content(),
            content: String::new(),
        }
        .sealed())
    }
}
