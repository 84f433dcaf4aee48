//! Soft ramps beside hard constraints.

use super::directive::{Directive, SOFT};

/// Steps of a ramp.
const RAMP_STEPS: usize = 8;

/// Adds soft ramps beside weights of 1 and -1 at the ends of curves, where there is no other target.
pub fn padded(all: &mut [Directive], pad: f64) {
    if pad <= 0.0 {
        return;
    }
    let mut order: Vec<(f64, f64, usize)> =
        all.iter().enumerate().filter_map(|(k, one)| one.curve.ends().map(|(a, b)| (a, b, k))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Free time before each start and after each end, with what overlaps it.
    let mut free = vec![(0.0_f64, 0.0_f64); all.len()];
    let mut latest = f64::NEG_INFINITY;
    for (from, to, k) in &order {
        free[*k].0 = (from - latest).min(*from).clamp(0.0, pad);
        latest = latest.max(*to);
    }
    // The two latest ends of the targets up to each.
    let mut running = Vec::with_capacity(order.len());
    let mut top = [(f64::NEG_INFINITY, usize::MAX); 2];
    for (_, to, k) in &order {
        if *to > top[0].0 {
            top = [(*to, *k), top[0]];
        } else if *to > top[1].0 {
            top[1] = (*to, *k);
        }
        running.push(top);
    }
    for (_, to, k) in &order {
        let next = order.partition_point(|(from, _, _)| from < to);
        let overlap = next
            .checked_sub(1)
            .map(|n| running[n])
            .is_some_and(|top| top.iter().any(|(end, other)| other != k && *other != usize::MAX && end > to));
        let gap = order.get(next).map_or(pad, |(from, _, _)| from - to);
        free[*k].1 = if overlap { 0.0 } else { gap.clamp(0.0, pad) };
    }
    for (Directive { curve, .. }, (before, after)) in all.iter_mut().zip(free) {
        let ramp = |at: f64, length: f64, weight: f64| -> Vec<(f64, f64)> {
            let point = |k: usize| {
                let x = k as f64 / RAMP_STEPS as f64;
                (at + length * (x - 1.0), weight * SOFT * 0.5 * (1.0 - (std::f64::consts::PI * x).cos()))
            };
            (0..=RAMP_STEPS).map(point).collect()
        };
        let (Some(first), Some(last)) = (curve.points.first().copied(), curve.points.last().copied()) else {
            continue;
        };
        if first.1.abs() == 1.0 && before > 0.0 {
            curve.points.splice(0..0, ramp(first.0, before, first.1));
        }
        if last.1.abs() == 1.0 && after > 0.0 {
            let mirrored = ramp(0.0, after, last.1).into_iter().rev().map(|(t, w)| (last.0 - t, w));
            curve.points.extend(mirrored);
        }
    }
}
