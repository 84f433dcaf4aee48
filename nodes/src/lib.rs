//! Typed nodes that turn motion and recordings into sound, usable with or without the `foley` runtime.
//!
//! Every algorithm is ordinary Rust on slices; a node is a thin typed description around it.
//! The families follow the field: [`io`] and [`dsp`] for audio, [`mesh`] for motion,
//! [`contact`] and [`friction`] for cloth that slides, [`curvature`] and [`crumple`] for cloth that crumples, [`tension`] for cloth
//! that is pulled tight, [`modal`] for objects that are struck, [`material`] for their damping and [`solid`] for their modes from a shape,
//! [`rigid`], [`texture`] and [`scrape`] for bodies that roll and scrape over surfaces, [`spatial`] for sounds in space, [`feature`], [`warp`] and [`mod@unit`] for sounds
//! put together from recordings, [`grain`] for grains of recordings that follow contacts, [`likeness`] for comparisons with recordings, [`take`] for takes cut out of raw
//! recordings, and [`table`] for tables of results. [`core`] defines nodes, and [`prelude`] holds the names of each family that a program
//! needs first.
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
pub mod grain;
pub mod io;
pub mod likeness;
pub mod live_input;
pub mod material;
pub mod mesh;
pub mod modal;
pub mod plot;
pub mod prelude;
pub mod registry;
pub mod rigid;
pub mod scrape;
pub mod solid;
pub mod soundtrack;
pub mod spatial;
pub mod table;
pub mod take;
pub mod tension;
pub mod texture;
pub mod unit;
pub mod warp;
