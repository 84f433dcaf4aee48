//! Arguments of `foley new`.

use clap::{Args as ClapArgs, ValueEnum};
use std::path::PathBuf;

/// Arguments of `foley new`.
#[derive(Clone, Debug, ClapArgs)]
pub struct NewArgs {
    /// The folder to make; its name becomes that of the graph
    pub dir: PathBuf,
    /// Subject of the project [default: that of the given files, or wind]
    #[arg(long, value_name = "NAME")]
    pub template: Option<Template>,
    /// Files of the user.
    #[command(flatten)]
    pub own: OwnFiles,
}

/// Files of the user that a new project is made of.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct OwnFiles {
    /// Copy this animation into the project, as the cloth; or this shape, as the object of a material
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Copy these recordings into the project: of the cloth, knocks on a material, grains, or recordings to resynthesise
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub recordings: Vec<PathBuf>,
    /// Copy this image into the project, as the surface
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Copy this log of contacts into the project
    #[arg(long, value_name = "FILE")]
    pub contacts: Option<PathBuf>,
}

/// Project that `foley new` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Template {
    /// Filtered noise
    Wind,
    /// Friction and crumples of a cloth
    Cloth,
    /// A surface from an image, under a ball or under the contacts of a log
    Texture,
    /// A bar that is struck
    Impact,
    /// A bar to strike while it plays
    Live,
    /// An object of a material that is fitted to recorded knocks
    Material,
    /// Recordings cut into grains, played by triggers or by the contacts of a log
    Grains,
    /// A resynthesised recording
    Numbers,
}
