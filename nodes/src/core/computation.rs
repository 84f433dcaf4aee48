//! Services for long computations: progress, partial results, and threads beside the graph.

use std::sync::Arc;

/// Watches a long computation: it takes the share that is done, from 0 to 1, and returns true if the computation is to stop.
///
/// A value node that takes seconds calls it now and then; stopped, it returns [`Fault::stopped`](crate::core::fault::Fault::stopped).
pub type Monitor<'a> = dyn Fn(f64) -> bool + Sync + 'a;

/// The [`Monitor`] of a computation that is not watched.
#[must_use]
pub fn unmonitored(_: f64) -> bool {
    false
}

/// Results of a long computation from which a later run continues, if it is stopped or killed.
///
/// They belong to the content of all inputs and parameters of a node. A value node that takes minutes loads them when it begins, and offers
/// what it has whenever a part of the work is done, and when it is stopped.
pub trait Partial: Sync {
    /// The partial result that was stored last, if the computation was interrupted.
    fn load(&self) -> Option<Vec<u8>>;

    /// Offers what is done so far. It is encoded and stored, in place of what was stored before, when enough time has passed. A failure is not
    /// reported: the computation then begins again.
    fn offer(&self, encode: &dyn Fn() -> Option<Vec<u8>>);
}

/// Partial results that are not stored.
#[derive(Clone, Copy, Debug, Default)]
pub struct NotStored;

impl Partial for NotStored {
    fn load(&self) -> Option<Vec<u8>> {
        None
    }

    fn offer(&self, _: &dyn Fn() -> Option<Vec<u8>>) {}
}

/// Runs work beside the windows of a graph, at once or on another thread: a node that analyses what it has received hands it over, and takes
/// the result from a channel at a later item.
pub type Background = Arc<dyn Fn(Box<dyn FnOnce() + Send>) + Send + Sync>;

/// The [`Background`] that runs all work at once.
#[must_use]
pub fn foreground() -> Background {
    Arc::new(|work| work())
}
