//! The contract between a node and its runner.

mod node_type;
mod per_item;

pub use node_type::{DynNode, NodeType};
pub use per_item::{EachPorts, PerItem};

use super::fault::{Fault, Reject};
use super::files::MemoryFiles;
use super::item::{Channels, Item};
use super::params::Params;
use super::ports::Ports;
use super::random::Rng;
use super::shape::{Build, Shape};
use super::silence::Silence;
use super::state::StateArchive;
use super::time::Rate;

/// Threads that may run a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// In the audio callback: no allocation, lock or system call in `run`.
    Audio,
    /// On a live worker thread.
    Worker,
    /// Reads or writes files: on an I/O thread.
    Io,
    /// In offline runs only.
    Offline,
}

impl Class {
    /// The class in one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Audio => "audio",
            Self::Worker => "worker",
            Self::Io => "io",
            Self::Offline => "offline",
        }
    }
}

/// Answer of a running node to new parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retune {
    /// The node has adopted them.
    Done,
    /// The node has to be built again.
    Rebuild,
}

/// Counters and measures of a finished run, for the report.
pub type Summary = Vec<(&'static str, serde_json::Value)>;

/// A node: a thin, typed description around maths on slices.
///
/// Life of a node:
/// 1. `shape` declares outputs and look-around, from parameters and the shapes of the inputs.
/// 2. `build` allocates everything.
/// 3. `run` fills one window after the other without gaps, from time zero or, in a graph that already plays, from
///    the time at which it continues; the views report this time.
/// 4. `finish` once, after the last window.
/// 5. `retune` and `adopt` in between, when its graph is edited.
pub trait Node: Sized + Send + 'static {
    /// Its parameters.
    type Params: Params;
    /// Its ports.
    type Ports: Ports;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Version, which increases when the same inputs result in another output.
    const VERSION: u32 = 1;
    /// Threads that may run it.
    const CLASS: Class;
    /// Rough nanoseconds per element of its widest input or output, from which offline runs cut a graph into parallel parts.
    const COST: f64 = 1.0;
    /// True if [`process_block`](Self::process_block) may stand for [`run`](Self::run).
    const TAKES_BLOCKS: bool = false;

    /// Declares rates, formats and lookaround.
    ///
    /// # Errors
    /// When parameters, inputs and assets do not go together.
    fn shape(params: &Self::Params, shape: &mut Shape<'_, '_, Self::Ports>) -> Result<(), Reject>;

    /// Makes the node and allocates all that it needs.
    ///
    /// # Errors
    /// When an asset cannot be read or an output not be made.
    fn build(params: &Self::Params, cx: &Build<'_>) -> Result<Self, Fault>;

    /// Fills one window.
    ///
    /// A node that does next to nothing per item marks its `run` as `#[inline]`: then its views never leave the registers.
    ///
    /// # Errors
    /// When the data make it impossible to continue.
    fn run(&mut self, io: <Self::Ports as Ports>::Io<'_>) -> Result<(), Fault>;

    /// Fills one window, as `run` would, for nodes whose work takes little longer than the opening of their ports.
    ///
    /// If [`TAKES_BLOCKS`](Self::TAKES_BLOCKS) is set, it is called instead of `run` where only the first input is linked, once, and read within
    /// the window alone. This input and the only output are streams of `f32` at one rate.
    fn process_block(&mut self, input: &[f32], out: &mut [f32]) {
        let _ = (input, out);
    }

    /// Ends the run: outputs folds, completes files, returns its counters.
    ///
    /// # Errors
    /// When that cannot be done.
    fn finish(&mut self, io: <Self::Ports as Ports>::Io<'_>) -> Result<Summary, Fault> {
        let _ = io;
        Ok(Summary::new())
    }

    /// Returns the reason for which it has given nothing so far although it received something; `None` if it has given something, or has no reason.
    ///
    /// A node that can refuse or swallow its input has a reason. Nothing may be allocated here.
    fn silence(&self) -> Option<Silence> {
        None
    }

    /// Adopts new parameters while running, or requires a rebuild.
    ///
    /// The result depends only on the two sets of parameters, and is the same if they are exchanged. Nothing may be
    /// allocated here.
    fn retune(&mut self, new: &Self::Params) -> Retune {
        let _ = new;
        Retune::Rebuild
    }

    /// Takes over the parts of the state of the node that it replaces that fit.
    ///
    /// The old node sounds on until it has been faded out, so it has to stay as it is. Nothing may be allocated here.
    fn adopt(&mut self, old: &mut Self) {
        let _ = old;
    }

    /// Receives true if the windows from now on are late in a graph that plays, and false when its thread has caught up.
    ///
    /// Late windows are not audible: an expensive node leaves out work whose result only they have. Nothing may be allocated
    /// here. An offline run is never late.
    fn set_late(&mut self, late: bool) {
        let _ = late;
    }

    /// Saves its state, or restores it into a node that was just built, which then continues
    /// with the same bits. Most nodes name their fields with [`archive_state!`](crate::archive_state).
    ///
    /// A node whose windows depend on its inputs and its parameters alone has no state.
    ///
    /// # Errors
    /// If the saved state is not of this node.
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let _ = archive;
        Ok(())
    }

    /// Valid parameters and the files they need, for trials.
    fn trial(rng: &mut Rng) -> (Self::Params, MemoryFiles) {
        (Self::Params::trial(rng), MemoryFiles::default())
    }
}

/// A node that only computes values from values and assets, before any stream starts.
pub trait Func: 'static {
    /// Its parameters.
    type Params: Params;
    /// Its ports: `Value` inputs and outputs only.
    type Ports: Ports;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Version, which increases when the same inputs result in another output.
    const VERSION: u32 = 1;
    /// True if its outputs contain the paths of its assets.
    const EXPOSES_PATHS: bool = false;

    /// Checks parameters and assets before the run.
    ///
    /// # Errors
    /// When they do not go together.
    fn check(params: &Self::Params, shape: &mut Shape<'_, '_, Self::Ports>) -> Result<(), Reject> {
        let _ = (params, shape);
        Ok(())
    }

    /// Computes the outputs.
    ///
    /// # Errors
    /// When the inputs make it impossible.
    fn eval(
        params: &Self::Params,
        cx: &Build<'_>,
        io: <Self::Ports as Ports>::Io<'_>,
    ) -> Result<Summary, Fault>;

    /// Valid parameters and the files they need, for trials.
    fn trial(rng: &mut Rng) -> (Self::Params, MemoryFiles) {
        (Self::Params::trial(rng), MemoryFiles::default())
    }
}

/// A node that makes each output item of the one input item at the same time.
pub trait Each: Sized + Send + 'static {
    /// Its parameters.
    type Params: Params;
    /// The input item.
    type In: Item;
    /// The output item.
    type Out: Item;
    /// Its name in graphs.
    const NAME: &'static str;
    /// Version, which increases when the same inputs result in another output.
    const VERSION: u32 = 1;
    /// Name and documentation of the input.
    const INPUT: (&'static str, &'static str);
    /// Name and documentation of the output.
    const OUTPUT: (&'static str, &'static str);

    /// The output's format.
    ///
    /// # Errors
    /// When parameters and input do not go together.
    fn format(
        params: &Self::Params,
        input: &<Self::In as Item>::Format,
    ) -> Result<<Self::Out as Item>::Format, Reject>;

    /// Makes the node for items of a format.
    fn new(params: &Self::Params, input: &<Self::In as Item>::Format) -> Self;

    /// Makes one item.
    fn each(&mut self, item: &[<Self::In as Item>::Elem], out: &mut [<Self::Out as Item>::Elem]);

    /// Returns its counters at the end.
    fn summary(&self) -> Summary {
        Summary::new()
    }

    /// As [`Node::archive_state`].
    ///
    /// # Errors
    /// As [`Node::archive_state`].
    fn archive_state(&mut self, archive: &mut StateArchive<'_>) -> Result<(), Fault> {
        let _ = archive;
        Ok(())
    }

    /// Valid parameters for trials.
    fn trial(rng: &mut Rng) -> Self::Params {
        Self::Params::trial(rng)
    }
}

/// Refuses a stream whose rate is not that of another input, and names the node that would change it.
///
/// # Errors
/// When `found` is not `wanted`.
pub fn same_rate(field: &str, found: Rate, other: &str, wanted: Rate) -> Result<(), Reject> {
    if wanted == found {
        return Ok(());
    }
    let message = format!("`{field}` runs at {found}, {other} at {wanted}");
    // The slower one of two inputs has nothing to lose.
    let (rate, at) = match other.starts_with('`') && wanted.as_f64() < found.as_f64() {
        true => (found, other.to_owned()),
        false => (wanted, format!("`{field}`")),
    };
    Err(Reject::new("F045", message)
        .at(field)
        .rate(wanted)
        .help(format!("put Resample(rate: {rate}) before {at}").replace(" Hz", "")))
}

/// Refuses audio of another channel count than another input.
///
/// # Errors
/// When `found` is not `wanted`.
pub fn same_channels(field: &str, found: Channels, other: &str, wanted: Channels) -> Result<(), Reject> {
    if wanted == found {
        return Ok(());
    }
    let message = format!("`{field}` has {} channels, {other} {}", found.0, wanted.0);
    Err(Reject::new("F046", message).at(field).help("put Channels, Mono or Pan before one of them"))
}
