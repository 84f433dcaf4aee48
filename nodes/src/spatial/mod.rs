//! Where things are and how that sounds: poses, a head with two ears, distance.
//!
//! A [`Pose`] is a place and a direction; own axes are x to the front, y to the left and z up, as in AES69. [`head`] is the
//! structural model of Brown and Duda, [`binaural`] plays it over audio, [`receiver`] puts it on spectra, [`still`] plays
//! short sounds each from a place of its own, [`distance`] fades
//! with the way, and [`air`] dulls.

pub mod air;
pub mod binaural;
pub mod distance;
pub mod distance_node;
pub mod head;
pub mod hrtf_node;
pub mod item;
mod line;
pub mod occlusion;
pub mod occlusion_node;
pub mod orbit_node;
pub mod pose;
pub mod pose_file;
pub mod pose_file_node;
pub mod receiver;
pub mod still;
pub(crate) mod track;
pub mod vertex_pose;

pub use binaural::Binaural;
pub use distance::{Distance, DistanceLine};
pub use head::{Ear, EarFilter, Head, PinnaSet, SPEED_OF_SOUND};
pub use item::Poses;
pub use pose::Pose;
pub use pose_file::{PoseFileError, PoseTrack, read_poses};
pub use receiver::HeadReceiver;
pub use still::StillSource;
