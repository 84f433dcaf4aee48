//! Plans of checked graphs: delays, buffers, memory, phases and regions, computed before a run.
//!
//! [`Plan::new`] shapes every node, then computes the delay of each behind the run:
//! `D(v) = max over inputs (D(u) + lag(u) + ahead(v))`, so that in topological order every node can always run.

mod delays;
mod listing;
mod live_plan;
mod memory;
mod offline_plan;
mod options;
mod partition;
mod phases;
mod region;
mod shapes;
mod wiring;

pub use delays::{Cause, Continuation, Delays};
pub use live_plan::{AudioSink, Draft, LivePlan, SinkContinuation};
pub use memory::format_bytes;
pub use offline_plan::{Phase, Plan, sound_shapes};
pub use options::{PlanOptions, WINDOW};
pub use partition::runs_on_worker;
pub use region::{BufferPlan, DEPTH, Export, Import, PlanInput, PlanNode, PlanOutput, Region, Runnable};
pub use shapes::shape_notes;
pub use wiring::TapPlan;
