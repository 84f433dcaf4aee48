//! Item 2: Choice of a unit of 57,000 for each of 140,000 targets of 3 and 6 dimensions: of the units within a radius, the one whose past is
//! most like that of the target, with a cool-off of 20.
//!
//! The others compare 10 units by the sum of squared distances; foley sums the distances. At the start of a target or of the database they
//! compare what is there, foley whole windows of the database only; where no unit is near enough, foley chooses the nearest one that is not in
//! its cool-off, the others the nearest. `whole` is the choice alone, `build` the index for it, which most of the others time too; `L5` compares
//! six units, the default of foley's node. foley has no search for all units within the radius, `radius` elsewhere: its selection does not need
//! them.

use super::data::autoregressive;
use super::measure::{Item, threads};
use foley_nodes::unit::{Selector, SelectorParams, Units, selector};

const UNITS: usize = 57_000;
const TARGETS: usize = 140_000;
const COOL_OFF: usize = 20;

/// Mean number of units within a radius of a target, from every 500th.
fn candidates(database: &[f32], target: &[f32], dims: usize, radius: f64) -> f64 {
    let near = |x: &[f32], y: &[f32]| {
        x.iter().zip(y).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>() <= radius * radius
    };
    let some = target.chunks_exact(dims).step_by(500);
    let number = some.len() as f64;
    some.map(|y| database.chunks_exact(dims).filter(|x| near(x, y)).count()).sum::<usize>() as f64 / number
}

/// Chooses a unit for each target, and returns the number of those without a unit within the radius.
fn choose(selector: &mut dyn Selector, target: &[f32], dims: usize, look: usize) -> usize {
    let mut far = 0;
    for i in 0..target.len() / dims {
        let window = &target[i.saturating_sub(look) * dims..(i + 1) * dims];
        far += usize::from(selector.choose(window).expect("features are finite").fallback);
    }
    far
}

fn bench_of(item: Item, dims: usize, radius: f64) {
    let t = threads();
    let (database, target) = (autoregressive(11, dims, UNITS), autoregressive(22, dims, TARGETS));
    item.print(&format!("mean-candidates.d{dims}"), candidates(&database, &target, dims, radius), "units");
    let units = Units::new(&database, dims, vec![(0, UNITS)]);
    // The units before the current one that are compared as well.
    for (look, name) in [(9, ""), (5, ".L5")] {
        let params = SelectorParams {
            look,
            d_max: radius,
            cool_off: COOL_OFF,
            loop_guard: 0,
            causal: true,
            effort: None,
        };
        let new = || selector(&units, params.clone()).expect("there are units");
        if name.is_empty() {
            item.time(&format!("build.d{dims}"), 1.0, "s", new);
        }
        let fresh = new();
        let far = choose(&mut *fresh.boxed_clone(), &target, dims, look);
        item.print(&format!("far.d{dims}{name}"), 100.0 * far as f64 / TARGETS as f64, "%");
        item.time(&format!("whole.d{dims}{name}.{t}t"), 1.0, "s", || {
            choose(&mut *fresh.boxed_clone(), &target, dims, look)
        });
    }
}

pub fn bench(item: Item) {
    bench_of(item, 3, 0.14);
    bench_of(item, 6, 0.575);
}
