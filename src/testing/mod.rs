//! Checks that are written beside a graph: for `piece.ron` the file `piece.test.ron`.
//!
//! [`TestFile`] is read with the location of every mistake, [`run`] runs its cases in memory, and [`judge`] compares the outputs with
//! what a check expects.

mod bounds;
mod checks;
mod file;
mod recording;
mod run;
mod verdict;

pub use bounds::Bounds;
pub use checks::{CHECKS, Check, CheckSpec, Field, Given, Kind};
pub use file::{Case, Expected, TestFile, graph_of, test_file_of};
pub use recording::{Recorder, Recording, Samples};
pub use run::{CaseError, CheckResult, Runner, Stored, run};
pub use verdict::{Verdict, judge};
