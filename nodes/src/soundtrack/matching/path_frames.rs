//! The node `PathFrames`.

use super::path::FragmentPath;
use crate::core::fault::Fault;
use crate::core::node::{Func, Summary};
use crate::core::ports::Value;
use crate::core::shape::Build;
use crate::soundtrack::motion::MotionCurve;
use crate::{params, ports};

params! {
    /// Returns the frames of an earlier animation along a path of fragments.
    ///
    /// For each frame of the new animation it is the number of a frame of the earlier one, whose fragments are stretched to those of the new. `CurveOut` writes them, to render the picture by the same path as its sound, and `FrameScore` makes a score of them.
    pub struct PathFramesParams {}
}
ports! {
    pub struct PathFramesPorts / PathFramesIo {
        in {
            /// The path.
            path: Value<FragmentPath>,
        }
        out {
            /// Numbers of frames, from 0.
            frames: Value<MotionCurve>,
        }
    }
}

/// The node over [`FragmentPath::frames`].
#[derive(Debug)]
pub struct PathFrames;

impl Func for PathFrames {
    type Params = PathFramesParams;
    type Ports = PathFramesPorts;
    const NAME: &'static str = "PathFrames";

    fn eval(_: &PathFramesParams, _: &Build<'_>, mut io: PathFramesIo<'_>) -> Result<Summary, Fault> {
        let frames = io.path.frames();
        let summary = vec![("frames", frames.frames().into())];
        io.frames.set(frames);
        Ok(summary)
    }
}
