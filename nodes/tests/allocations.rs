//! Nodes for the audio thread never allocate while they run.
//!
//! The counting allocator requires unsafe code, so this test is a separate binary.
#![allow(unsafe_code)]

mod trial;

use foley_nodes::core::node::{Class, Retune};
use foley_nodes::registry::all;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use trial::{Level, Trial, accepted};

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

fn count() {
    // A thread that is ending has no counter; it runs no nodes.
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes to the system's allocator unchanged; the counter is a plain cell of this thread.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller upholds the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller upholds the contract of `dealloc`.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller upholds the contract of `realloc`.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_counter_counts() {
    let before = COUNT.get();
    drop(std::hint::black_box(vec![0_u8; 100]));
    assert_eq!(COUNT.get() - before, 2);
}

#[test]
fn audio_nodes_neither_allocate_nor_free_while_they_run() {
    let mut total_windows = 0;
    for (node, ty) in all().iter().enumerate().filter(|(_, ty)| ty.class == Class::Audio && ty.eval.is_none())
    {
        for trial in accepted(node, Level::Random, 8) {
            for window in [trial.fastest_rate().span(64), trial.fastest_rate().span(1)] {
                let mut run = trial.standalone(window).start().unwrap_or_else(|e| panic!("{e}: {trial:?}"));
                let before = COUNT.get();
                let mut windows = 0;
                while run.step().unwrap_or_else(|e| panic!("{e}: {trial:?}")) {
                    windows += 1;
                }
                let calls = COUNT.get() - before;
                assert_eq!(calls, 0, "`{}` calls the allocator in {windows} windows: {trial:?}", ty.name);
                total_windows += windows;
            }
        }
    }
    assert!(total_windows > 1000, "{total_windows} windows");
}

/// The result of `retune` depends on the parameters only and is symmetric. Neither `retune` nor `adopt` calls the allocator, since a
/// playing graph calls them in the audio callback.
#[test]
fn audio_nodes_neither_allocate_nor_free_while_they_are_retuned_or_adopt() {
    let mut done = 0;
    for (node, ty) in all().iter().enumerate().filter(|(_, ty)| ty.class == Class::Audio && ty.eval.is_none())
    {
        let trials = accepted(node, Level::Random, 8);
        for (a, b) in (0..trials.len()).flat_map(|a| (0..trials.len()).map(move |b| (a, b))) {
            // Both use the inputs of the first trial, if they are compatible with the parameters of the second.
            let (own, other) = (&trials[a], trials[a].with_params(&trials[b]));
            let start = |trial: &Trial| trial.standalone(trial.fastest_rate().span(64)).start();
            let (Ok(mut first), Ok(mut second)) = (start(own), start(&other)) else { continue };
            let before = COUNT.get();
            let forward = first.node().retune(other.params());
            let calls = COUNT.get() - before;
            assert_eq!(forward, second.node().retune(own.params()), "`{}`: {own:?}, {other:?}", ty.name);
            if forward == Retune::Done {
                assert_eq!(calls, 0, "`{}` calls the allocator when retuned: {own:?}, {other:?}", ty.name);
                done += 1;
            }
            let (Ok(mut old), Ok(mut new)) = (start(own), start(own)) else { continue };
            while old.step().is_ok_and(|more| more) {}
            let before = COUNT.get();
            new.node().adopt(old.node());
            assert_eq!(COUNT.get() - before, 0, "`{}` calls the allocator when it adopts", ty.name);
        }
    }
    assert!(done > 100, "{done} retunes");
}
