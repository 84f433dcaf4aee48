//! Typed nodes that turn motion and recordings into sound, usable with or without the `foley` runtime.
//!
//! Every algorithm is ordinary Rust on slices; a node is a thin typed description around it.
//! The families follow the field: [`io`] and [`dsp`] for audio, [`mesh`] for motion,
//! [`contact`] and [`friction`] for cloth that slides, [`curvature`] and [`crumple`] for cloth that crumples, [`tension`] for cloth
//! that is pulled tight, [`modal`] for objects that are struck, [`material`] for their damping and [`solid`] for their modes from a shape,
//! [`rigid`], [`texture`] and [`scrape`] for bodies that roll and scrape over surfaces, [`spatial`] for sounds in space, [`feature`], [`warp`] and [`mod@unit`] for sounds
//! put together from recordings, [`grain`] for grains of recordings that follow contacts, [`likeness`] for comparisons with recordings, [`take`] for takes cut out of raw
//! recordings, and [`table`] for tables of results. [`statistics`] is what estimates of several families share. [`core`] defines nodes, and [`prelude`] holds the names of each family that a program
//! needs first.
//!
//! # Mel cepstrum of a sound
//!
//! ```
//! use foley_nodes::core::time::Rate;
//! use foley_nodes::feature::{FeatureConventions, MelCepstrum};
//!
//! let sound: Vec<f32> = (0..48_000).map(|n| (0.002 * (n as f32).powi(2)).sin()).collect();
//! let conventions = FeatureConventions::cloth(Rate::hz(48_000), 600);
//! let mut cepstrum = MelCepstrum::new(&conventions, 1e-10);
//! let mut features = vec![0.0; conventions.dims()];
//! // A frame is longer than a unit.
//! for frame in sound.windows(cepstrum.frame()).step_by(600) {
//!     cepstrum.process(frame, &mut features);
//! }
//! ```
//!
//! [`io::AudioReader`] reads the samples of a file.
//!
//! # Modes under impacts
//!
//! ```
//! use foley_nodes::modal::{Bank, BankOutput, ForceRing, Modes, PulseShape};
//!
//! let bell = Modes::new("bell", vec![440.0, 1210.0], vec![3.0, 5.0], vec![1.0, 0.5])?;
//! let (mut force, mut sound) = (vec![0.0; 44_100], vec![0.0; 44_100]);
//! // One contact point, and pulses that end at most a second after the next sample.
//! let mut ring = ForceRing::new(44_100.0, 1, 1.0);
//! for (seconds, newton_seconds) in [(0.0, 0.01), (0.25, 0.003), (0.4, 0.02)] {
//!     assert!(ring.add(seconds * 44_100.0, 0, newton_seconds, 0.001, PulseShape::Cosine));
//! }
//! ring.read(&mut force);
//! // A force in N; the bank takes the impulse of each sample, in N s.
//! force.iter_mut().for_each(|x| *x /= 44_100.0);
//! Bank::new(&bell, 44_100.0, BankOutput::Acceleration)?.process(&force, &mut sound);
//! let peak = sound.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
//! assert!((0.01..0.1).contains(&peak));
//! # Ok::<(), foley_nodes::modal::ModesError>(())
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::print_stderr, clippy::print_stdout))]

pub mod artefact;
pub mod contact;
pub mod core;
pub mod crumple;
pub mod curvature;
pub mod dsp;
pub mod feature;
pub mod friction;
#[cfg(feature = "grains")]
pub mod grain;
pub mod io;
pub mod likeness;
pub mod live_input;
#[cfg(feature = "material")]
pub mod material;
pub mod mesh;
pub mod modal;
pub mod plot;
pub mod prelude;
pub mod registry;
pub mod rigid;
#[cfg(feature = "texture")]
pub mod scrape;
#[cfg(feature = "material")]
pub mod solid;
#[cfg(feature = "numbers")]
pub mod soundtrack;
pub mod spatial;
pub mod statistics;
pub mod table;
pub mod take;
pub mod tension;
#[cfg(feature = "texture")]
pub mod texture;
pub mod unit;
pub mod warp;
