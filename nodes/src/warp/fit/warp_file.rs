//! A warp from its file, as a node.

use super::warp::Warp;
use crate::artefact::value_file::{Artefact, from_json};
use crate::artefact_file;
use crate::core::node::Summary;

impl Artefact for Warp {
    const CODE: &'static str = "F111";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        let warp: Self = from_json(bytes)?;
        warp.fault().or_else(|| warp.altered()).map_or(Ok(warp), Err)
    }

    fn summary(&self) -> Summary {
        Warp::summary(self)
    }
}

artefact_file! {
    /// A warp from a file: JSON as a tap of `TpsFit` writes it.
    ///
    /// Its `content` is a digest of everything else in it. A warp with a wrong digest, as after an edit by hand, is refused; without
    /// `content` it is not checked.
    pub struct WarpFile / WarpFileParams / WarpFilePorts / WarpFileIo, version 5;
    /// The file.
    path: "trial.warp";
    /// The warp.
    warp: Warp;
}
