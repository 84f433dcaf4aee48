//! The names that a program needs first, one module per family of nodes.
//!
//! ```
//! use foley_nodes::prelude::cloth::*;
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! assert_eq!(vertex_areas(&positions, &[[0, 1, 2]]).iter().sum::<f32>(), 0.5);
//! ```

/// To write node types.
pub mod node {
    pub use crate::core::fault::{Fault, Reject};
    pub use crate::core::node::{Class, Func, Node, Summary};
    pub use crate::core::ports::{Events, Stream, Value};
    pub use crate::core::shape::{Build, Ends, Shape};
    pub use crate::core::standalone::Standalone;
    pub use crate::core::state::{StateArchive, Stateful};
    pub use crate::core::time::{Rate, Tick};
    pub use crate::registry::Registry;
    pub use crate::{impl_state, params, ports};
}

/// To read, write and process audio.
pub mod audio {
    pub use crate::core::time::Rate;
    pub use crate::dsp::{
        Band, Biquad, Butterworth, Cascade, Delay, Fade, FadeLaw, FractionalDelay, LevelMeter, Pan,
        PeakLimiter, Quality, Resampler, db_to_linear, linear_to_db,
    };
    pub use crate::io::{AudioError, AudioReader, AudioWriter, WriteFormat, WriteSpec, probe};
}

/// Cloth: meshes, contact, friction, crumpling and tightness.
pub mod cloth {
    pub use crate::contact::{Contact, Contacts, Detector, DetectorParams, Speeds};
    pub use crate::core::time::Rate;
    pub use crate::crumple::{BuckleDetector, CrumpleBank, CrumpleEvents, EnergyMap};
    pub use crate::curvature::{MeanCurvature, OneRing};
    pub use crate::friction::{FrictionModel, IftNoise, IftNoiseParams};
    pub use crate::mesh::{
        Mesh, MeshClip, MeshError, MeshLimits, ReadOptions, Topology, alembic, gltf, open_mdd,
        open_obj_sequence, open_pc2, vertex_areas,
    };
    pub use crate::tension::{TautParams, Tightness};
}

/// Rigid bodies that hit, roll and scrape over textured surfaces.
pub mod texture {
    pub use crate::core::time::Rate;
    #[cfg(feature = "impact")]
    pub use crate::modal::{Bank, Modes, read_modes};
    pub use crate::modal::{ForceRing, Impact, PulseShape, read_impacts};
    #[cfg(feature = "impact")]
    pub use crate::rigid::{Classifier, LogOptions, Rules, read_contacts};
    pub use crate::rigid::{ContactFrame, ContactState};
    #[cfg(feature = "texture")]
    pub use crate::scrape::{IsophoteForce, MapForce, NoiseForce, PathPiece, PathRules, Tracker};
    #[cfg(feature = "texture")]
    pub use crate::texture::decode::decode;
    #[cfg(feature = "texture")]
    pub use crate::texture::{Drawing, Grid, Isophotes, Levels, Luma, LumaKind, Surface, Wrap, isophotes};
}

/// Recordings cut to units, selected by features and put together again.
pub mod recordings {
    pub use crate::core::time::Rate;
    pub use crate::feature::{FeatureConventions, Features, MelCepstrum};
    pub use crate::io::AudioReader;
    pub use crate::unit::{Concatenator, Pick, Selector, SelectorParams, UnitDatabase, join, selector};
    pub use crate::warp::{
        Correspondence, CorrespondenceSet, Warp, fit, read_correspondences, suggest, write_correspondences,
    };
}

/// Soundtracks that follow motion: textures, scores, queries.
#[cfg(feature = "numbers")]
pub mod soundtrack {
    pub use crate::soundtrack::matching::{
        QueryRules, best_matches, best_path, candidates, cuts, path_to_score, spots,
    };
    pub use crate::soundtrack::motion::{MotionCurve, read_curve_table};
    pub use crate::soundtrack::score::{Constraints, SoundScore, read_edits, read_score, write_score};
    pub use crate::soundtrack::synthesis::{SynthesisRules, Synthesizer, TextureStream};
    pub use crate::soundtrack::wavelet::{
        StreamingInverse, TextureModel, ThresholdRules, TreeRecording, TreeRules, Wavelet, WaveletTree,
    };
}

/// Sound in space: distance, pan, head and obstacles.
pub mod spatial {
    pub use crate::core::time::Rate;
    pub use crate::spatial::{Binaural, Distance, Head, Pinna, Pose, Poses, StaticSource, read_poses};
}
