//! A fitted warp as an artefact.

use serde::{Deserialize, Serialize};

use super::figure::{self, Cloud};
use super::report::{FitError, FitReport, Stiffness};
use super::spline_fit::fit;
use crate::core::content::{altered_content, content_digest};
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::feature::FeatureConventions;
use crate::warp::spline::tps::{Orientation, evenly_spaced};
use crate::warp::spline::{Pair, Tps};

/// Format of [`Warp`] that this code reads and writes.
pub const WARP_VERSION: u32 = 1;
/// Maximum number of units that are tested for folds.
const MAX_SURVEYED: usize = 4096;
/// Units farther from the middle than this many radii of the nodes are extrapolated.
const MAX_RADII: f64 = 2.0;
/// Maximum number of vectors of each kind in the figure.
const MAX_DRAWN: usize = 400;

/// The warp of one channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WarpMap {
    /// The spline.
    pub spline: Tps,
    /// Figures of the fit.
    pub report: FitReport,
    /// Largest distance of a node from the middle of all.
    pub radius: f64,
    /// Share of the target's units where the warp folds over: those with an orientation opposite to most.
    pub folds: f64,
    /// True if it mirrors most of them, which alone is no fold.
    #[serde(default)]
    pub mirrored: bool,
    /// Share of the target's units farther than two radii from the middle of the nodes.
    pub outside: f64,
    /// Some vectors of both worlds, for the figure.
    pub cloud: Cloud,
}

/// A warp of target features to similar features of the database, with its sources.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warp {
    /// [`WARP_VERSION`].
    pub version: u32,
    /// Conventions of the features.
    pub conventions: FeatureConventions,
    /// One map per feature vector of a unit, or one for all.
    pub maps: Vec<WarpMap>,
    /// File of the correspondences.
    pub correspondences: String,
    /// Recordings of the database.
    pub recordings: Vec<String>,
    /// Digest of the content of each of them; empty in older files.
    #[serde(default)]
    pub contents: Vec<String>,
    /// Digest of the correspondences, as [`CorrespondenceSet::content`](crate::warp::CorrespondenceSet::content)
    /// returns it, independent of the file name; empty in older files.
    #[serde(default)]
    pub correspondences_content: String,
    /// Digest of all of the above, which detects changes by hand; empty if none was written.
    #[serde(default)]
    pub content: String,
}

impl WarpMap {
    /// Fits a map and measures its effect on the target.
    ///
    /// # Shapes
    /// `target` and `database`: `[units, d]`.
    ///
    /// # Errors
    /// As [`fit`].
    pub fn fit(
        pairs: &[Pair],
        d: usize,
        stiffness: Stiffness,
        target: &[f32],
        database: &[f32],
    ) -> Result<Self, FitError> {
        let (spline, report) = fit(pairs, d, stiffness)?;
        let mut this = Self {
            spline,
            report,
            cloud: Cloud::new(pairs, target, database, d, MAX_DRAWN),
            ..Self::default()
        };
        this.survey(target);
        Ok(this)
    }

    fn survey(&mut self, target: &[f32]) {
        let (d, tps) = (self.spline.dims, &self.spline);
        let distance_from_centre = |x: &mut dyn Iterator<Item = f64>| {
            x.zip(&tps.centre).map(|(x, c)| (x - c).powi(2)).sum::<f64>().sqrt()
        };
        self.radius = tps
            .nodes
            .chunks_exact(d)
            .map(|x| distance_from_centre(&mut x.iter().copied()))
            .fold(0.0, f64::max);
        let units: Vec<usize> = evenly_spaced(target.len() / d, MAX_SURVEYED).collect();
        let far = |k: &&usize| {
            let unit = target.get(*k * d..(*k + 1) * d).unwrap_or_default();
            distance_from_centre(&mut unit.iter().map(|x| f64::from(*x))) > MAX_RADII * self.radius
        };
        let outside = if tps.is_empty() { 0 } else { units.iter().filter(far).count() };
        let orientation = Orientation::new(target, tps, &units);
        (self.folds, self.mirrored) = (orientation.folds(), orientation.mirrored());
        self.outside = outside as f64 / units.len().max(1) as f64;
    }
}

impl Warp {
    /// The first fault, if any.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        if self.version != WARP_VERSION {
            return Some(format!(
                "the warp has version {}; this reads version {WARP_VERSION}: fit it again",
                self.version
            ));
        }
        let d = self.conventions.dims();
        if self.maps.is_empty() {
            return Some("the warp holds no map".into());
        }
        self.maps.iter().find_map(|map| {
            if map.spline.dims != d {
                return Some(format!("a map has {} dimensions; the features have {d}", map.spline.dims));
            }
            map.spline.fault().map(|fault| format!("a map cannot be used: {fault}"))
        })
    }

    fn digest(&self) -> String {
        let later = ["\"contents\":[],", "\"correspondences_content\":\"\","];
        content_digest(&Self { content: String::new(), ..self.clone() }, &later)
    }

    /// The same warp with the digest of its content.
    #[must_use]
    pub fn sealed(self) -> Self {
        Self { content: self.digest(), ..self }
    }

    /// A message if the warp of a file differs from the one that was written.
    #[must_use]
    pub fn altered(&self) -> Option<String> {
        altered_content(&self.content, &self.digest(), "fit it")
    }

    /// Figures of the first map for the summary of a run.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let Some(map) = self.maps.first() else { return Summary::new() };
        let warnings: Vec<&String> = self.maps.iter().flat_map(|m| &m.report.warnings).collect();
        vec![
            ("pairs", map.report.pairs.into()),
            ("nodes", map.report.nodes.into()),
            ("lambda", map.report.lambda.into()),
            ("degrees_of_freedom", map.report.freedom.into()),
            ("residual", map.report.residual.into()),
            ("conflict", map.report.conflict.into()),
            ("folds", map.folds.into()),
            ("mirrored", map.mirrored.into()),
            ("outside", map.outside.into()),
            ("warnings", serde_json::json!(warnings)),
        ]
    }
}

impl Data for Warp {
    const NAME: &'static str = "warp";
    const PLOTS: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let conventions = FeatureConventions::trial();
        let d = conventions.dims();
        let mut vector = || (0..d).map(|_| rng.between(-3.0, 3.0)).collect::<Vec<_>>();
        let pairs: Vec<Pair> = (0..6).map(|_| Pair { from: vector(), to: vector(), weight: 1.0 }).collect();
        let count = rng.below(pairs.len() + 1);
        // A stiff fit of scattered pairs always exists.
        let map = WarpMap::fit(&pairs[..count], d, Stiffness::Lambda(1.0), &[], &[]).unwrap_or_default();
        Self {
            version: WARP_VERSION,
            conventions,
            maps: vec![map],
            correspondences: String::new(),
            recordings: Vec::new(),
            contents: Vec::new(),
            correspondences_content: String::new(),
            content: String::new(),
        }
        .sealed()
    }

    fn plot(&self) -> Option<String> {
        self.maps.first().map(|map| figure::draw(&map.spline, &map.cloud, &map.report))
    }
}
