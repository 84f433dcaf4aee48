//! Positions of sources and listeners, and their effect on sound.
//!
//! A [`Pose`] is a position and an orientation. Its local axes are x to the front, y to the left and z up, as in AES69. Data flows from
//! [`motion`] through [`propagation`] and [`hrtf`] to [`obstruction`]. [`interaural`] gives a sound the differences between the ears of another.

pub mod hrtf;
pub mod interaural;
pub mod motion;
pub mod obstruction;
pub mod propagation;

pub use hrtf::binaural::Binaural;
pub use hrtf::head::{Ear, EarFilter, Head, PinnaSet};
pub use hrtf::receiver::HeadReceiver;
pub use hrtf::static_source::StaticSource;
pub use hrtf::structural_hrtf::Pinna;
pub use interaural::cue_transfer::{CueFrames, CueTransfer};
pub use motion::item::Poses;
pub use motion::pose::{self, Pose};
pub use motion::pose_track::{PoseFileError, PoseTrack, read_poses};
pub use propagation::distance::{Distance, DistanceLine, SPEED_OF_SOUND};
