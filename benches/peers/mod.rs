//! The same works as programs beside foley: 14 items, each timed on one thread, in the format of the scripts that time the others.
//!
//! `cargo bench -p foley -- peers 02 09` runs the named items, without a name all of them. A line is a figure: item, `foley`, metric, value and
//! unit, separated by tabs. A metric `m` is the median wall time of the runs after one that does not count, `m.min` the least, `m.cpu` the
//! median processor time of all threads, `m.runs` the number of runs. On a machine with other work only `m.cpu` can be compared. `PEERS_RUNS` is
//! the number of runs, `PEERS_THREADS` that of threads.
//!
//! `run.sh` runs each item in a process of its own. `compare.sh` runs foley and the others in turn.

mod contact;
mod correlation;
mod damping;
mod data;
mod dtw;
mod graph;
mod image;
pub mod measure;
mod mfcc;
mod modal;
mod modes;
mod noise;
mod onsets;
mod selection;
mod spline;
mod wavelet;

use measure::Item;

type Work = (&'static str, fn(Item));

const WORKS: [Work; 14] = [
    ("01-mfcc", mfcc::bench),
    ("02-units", selection::bench),
    ("03-tps", spline::bench),
    ("04-emg", damping::bench),
    ("05-onset", onsets::bench),
    ("06-ncc", correlation::bench),
    ("07-wavelet", wavelet::bench),
    ("08-dtw", dtw::bench),
    ("09-image", image::bench),
    ("10-modal-bank", modes::bench),
    ("11-ifft", noise::bench),
    ("12-contact", contact::bench),
    ("13-graph", graph::bench),
    ("14-modal", modal::bench),
];

pub fn bench() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let named = |(name, _): &&Work| args.iter().any(|arg| *arg == name[..2]);
    let any = WORKS.iter().any(|work| named(&work));
    let chosen: Vec<&Work> = WORKS.iter().filter(|work| !any || named(work)).collect();
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(measure::threads()).build().expect("threads start");
    for (name, work) in &chosen {
        let item = Item(name);
        pool.install(|| work(item));
        // The peak of a process never falls, so it is that of an item only if there is no other.
        if let ([_], Some(megabytes)) = (&chosen[..], measure::peak_memory()) {
            item.print("rss.peak", megabytes, "MB");
        }
    }
}
