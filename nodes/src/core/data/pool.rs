//! Work that a node divides among the threads of the pool in which it runs.

use rayon::iter::IndexedParallelIterator;
use rayon::iter::plumbing::{Producer, ProducerCallback};

/// Applies a function to all items: on the threads of the pool that it is called in, and otherwise one after the other. Outside of a pool, as
/// in live use, nothing waits for other threads. Never allocates.
pub(crate) fn for_each<I: IndexedParallelIterator>(items: I, apply: impl Fn(I::Item) + Send + Sync) {
    if is_parallel() {
        items.for_each(apply);
    } else {
        items.with_producer(InOrder(apply));
    }
}

/// True in a pool of several threads.
pub(crate) fn is_parallel() -> bool {
    // Outside of a pool the number of threads is that of a pool for everybody, which would be made for the answer.
    rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1
}

/// Applies a function to the items of a producer in their order.
struct InOrder<F>(F);

impl<T, F: Fn(T)> ProducerCallback<T> for InOrder<F> {
    type Output = ();

    fn callback<P: Producer<Item = T>>(self, producer: P) {
        producer.into_iter().for_each(self.0);
    }
}

/// Runs a test in a pool of three threads.
#[cfg(test)]
pub(crate) fn with_threads<T: Send>(test: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(test)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::Mutex;
    use std::thread::{ThreadId, current};

    fn threads() -> (Vec<usize>, Vec<ThreadId>) {
        let seen = Mutex::new((Vec::new(), Vec::new()));
        let items: Vec<usize> = (0..100).collect();
        for_each(items.par_chunks(7), |part| {
            let mut seen = seen.lock().unwrap();
            seen.0.extend(part);
            seen.1.push(current().id());
        });
        seen.into_inner().unwrap()
    }

    #[test]
    fn outside_of_a_pool_the_calling_thread_applies_it_in_order() {
        let (items, threads) = threads();
        assert_eq!(items, (0..100).collect::<Vec<_>>());
        assert!(threads.iter().all(|thread| *thread == current().id()));
    }

    #[test]
    fn in_a_pool_every_item_is_met_once_by_its_threads() {
        let caller = current().id();
        let (mut items, threads) = with_threads(threads);
        items.sort_unstable();
        assert_eq!(items, (0..100).collect::<Vec<_>>());
        assert!(threads.iter().all(|thread| *thread != caller));
    }
}
