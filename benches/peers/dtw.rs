//! Item 8: The place in a random walk of 100,000 frames that is most like a noisy copy of 200 of them, by dynamic time warping.
//!
//! The others warp without limits and in double precision. foley compares windows of nine lengths, half to twice that of the query, in single
//! precision, and warps them by a tenth of their length at most.

use super::data::Rng;
use super::measure::Item;
use foley_nodes::core::computation::unmonitored;
use foley_nodes::soundtrack::matching::{Normalisation, QueryRules, best_matches};
use foley_nodes::soundtrack::motion::MotionCurve;

const FRAMES: usize = 100_000;
const QUERY: usize = 200;
const PLACE: usize = 61_234;
const RATE: f64 = 60.0;

pub fn bench(item: Item) {
    let mut rng = Rng(8);
    let mut at = 0.0;
    let walk: Vec<f32> = (0..FRAMES)
        .map(|_| {
            at += 0.1 * rng.normal();
            at as f32
        })
        .collect();
    let copy = walk[PLACE..PLACE + QUERY].iter().map(|x| x + 0.05 * rng.normal() as f32).collect();
    let curve = |values| MotionCurve { rate: RATE, channels: 1, values, gaps: Vec::new() };
    let (walk, copy) = (curve(walk), curve(copy));
    let rules = QueryRules {
        count: Some(1),
        threshold: 0.001,
        normalisation: Normalisation::None,
        ..QueryRules::default()
    };
    let find = || {
        best_matches(&walk, &copy, (0.0, QUERY as f64 / RATE), rules, &unmonitored)
            .expect("a query that moves")
    };
    let start = find().first().map_or(f64::NAN, |found| (found.from * RATE).round());
    item.print("best-start(61234)", start, "index");
    item.time("best-match", 1.0, "s", find);
}
