//! What the types of items, events and values declare.

use crate::core::random::Rng;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// The type of the items of a stream.
///
/// The *format* is what is fixed for a whole stream when the graph is planned: a channel count, the faces of a mesh.
pub trait Item: 'static {
    /// One element; an item is `width` of them in a row.
    type Elem: Copy + Default + PartialEq + Debug + Serialize + DeserializeOwned + Send + Sync + 'static;
    /// Properties that are constant over a stream.
    type Format: Clone + PartialEq + Debug + Send + Sync + 'static;
    /// The name that people see, such as `audio`.
    const NAME: &'static str;
    /// Names of the numbers in one element; one empty name where it is one number.
    const COLUMNS: &'static [&'static str];
    /// True if it is a waveform: tapped as a WAV file.
    const WAVE: bool = false;
    /// Elements per item.
    fn width(format: &Self::Format) -> usize;
    /// The format for people: `2 channels`.
    fn describe(format: &Self::Format) -> String;
    /// A small format for trials.
    fn trial_format(rng: &mut Rng) -> Self::Format;
    /// A valid element at index `place` of an item of this format, for trials.
    fn trial(format: &Self::Format, place: usize, rng: &mut Rng) -> Self::Elem;
    /// Returns true if every number in it is finite.
    fn finite(elem: &Self::Elem) -> bool;
    /// An element that no node writes, to find those left unwritten.
    fn poison() -> Self::Elem;
    /// The numbers of an element, one per column.
    fn numbers(elem: &Self::Elem, out: &mut Vec<f32>);
}

/// Audio: samples with full scale at +-1, interleaved by channel.
impl Item for f32 {
    type Elem = f32;
    type Format = Channels;
    const NAME: &'static str = "audio";
    const COLUMNS: &'static [&'static str] = &[""];
    const WAVE: bool = true;

    fn width(format: &Channels) -> usize {
        usize::from(format.0)
    }

    fn describe(format: &Channels) -> String {
        match format.0 {
            1 => "mono".into(),
            2 => "stereo".into(),
            n => format!("{n} channels"),
        }
    }

    fn trial_format(rng: &mut Rng) -> Channels {
        Channels(1 + rng.below(3) as u16)
    }

    fn trial(_: &Channels, _: usize, rng: &mut Rng) -> f32 {
        rng.between(-1.0, 1.0) as f32
    }

    fn finite(elem: &f32) -> bool {
        elem.is_finite()
    }

    fn poison() -> f32 {
        f32::NAN
    }

    fn numbers(elem: &f32, out: &mut Vec<f32>) {
        out.push(*elem);
    }
}

/// Number of channels of an audio stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Channels(pub u16);

/// The type of an event.
pub trait Event: Clone + PartialEq + Debug + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The name that people see.
    const NAME: &'static str;
    /// A valid event for trials.
    fn trial(rng: &mut Rng) -> Self;
}

/// A thing that is ready before streams start, shared and never changed.
pub trait Data: Debug + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The name that people see, such as `friction model`.
    const NAME: &'static str;
    /// True if its values have drawings, except empty ones.
    const PLOTS: bool = false;
    /// True if they have a file format of their own.
    const FILES: bool = false;
    /// A valid value for trials.
    fn trial(rng: &mut Rng) -> Self;
    /// A drawing of it as SVG, where it has one.
    fn plot(&self) -> Option<String> {
        None
    }
    /// Its binary file, for types that are too large as text.
    fn file(&self) -> Option<Vec<u8>> {
        None
    }
}

/// A number that was found before streams start, such as a gain.
impl Data for f64 {
    const NAME: &'static str = "number";

    fn trial(rng: &mut Rng) -> Self {
        rng.between(-10.0, 10.0)
    }
}
