//! Time and quality of motion queries.

use super::least;
use crate::common::folder;
use foley_nodes::core::computation::unmonitored;
use foley_nodes::core::random::Rng;
use foley_nodes::mesh::UpAxis;
use foley_nodes::soundtrack::matching::{MotionMatch, Normalisation, QueryRules, best_matches};
use foley_nodes::soundtrack::motion::MotionCurve;
use foley_nodes::spatial::motion::bvh::Bvh;

/// A random walk of the given feedback.
fn walk(frames: usize, feedback: f64, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    let mut x = 0.0;
    let mut next = || {
        x = feedback * x + rng.between(-1.0, 1.0);
        x as f32
    };
    (0..frames).map(|_| next()).collect()
}

pub fn queries() {
    let curve = |values| MotionCurve { rate: 60.0, channels: 1, values, gaps: Vec::new() };
    let threads = rayon::current_num_threads();
    // The work of the peers: the place of a noisy copy of 200 frames in a random walk.
    let series = curve(walk(100_000, 1.0, 8));
    let mut rng = Rng::new(9);
    let copy =
        series.values[61_234..61_434].iter().map(|x| x + 0.5 * rng.between(-1.0, 1.0) as f32).collect();
    let (copy, whole) = (curve(copy), (0.0, 200.0 / 60.0));
    for (name, normalisation) in
        [("as it is", Normalisation::None), ("without its mean", Normalisation::Offset)]
    {
        let rules = QueryRules { count: Some(1), threshold: 0.001, normalisation, ..QueryRules::default() };
        let search = || best_matches(&series, &copy, whole, rules, &unmonitored).unwrap_or_default();
        let start = search().first().map_or(f64::NAN, |m| m.from * 60.0);
        println!(
            "best match of 200 in 100,000 frames, 9 lengths, {name}: {:.1} ms on {threads} threads, at {start:.0} (61234)",
            least(search),
        );
    }
    let series = curve(walk(100_000, 0.995, 5));
    let interval = (600.0, 600.0 + 200.0 / 60.0);
    for threshold in [0.9, 0.7, 0.5] {
        let rules = QueryRules { threshold, ..QueryRules::default() };
        let search = || best_matches(&series, &series, interval, rules, &unmonitored).unwrap_or_default();
        let found = search().len();
        println!(
            "query of 200 in 100,000 frames, 9 lengths, threshold {threshold}: {:.1} ms on {threads} threads, {found} matches",
            least(search),
        );
        for tolerance in [0.01, 0.1] {
            let rules = QueryRules { tolerance: Some(tolerance), ..rules };
            let search = || best_matches(&series, &series, interval, rules, &unmonitored).unwrap_or_default();
            let found = search().len();
            println!(
                "  by iterative deepening, tolerance {tolerance}: {:.1} ms, {found} matches",
                least(search)
            );
        }
    }
}

/// Positions of a joint relative to the root at 60 Hz, of extent 1.
fn joint(file: &str, name: &str, up: UpAxis) -> Option<Vec<f32>> {
    let bvh = Bvh::read(&std::fs::read(folder("mocap").join(file)).ok()?).ok()?;
    let (joint, rate) = (bvh.joint(name)?, bvh.rate()?.as_f64());
    let position = |frame: usize| -> Option<[f64; 3]> {
        let [a, b] = [joint, 0].map(|joint| bvh.pose(joint, frame, 1.0, up));
        let (a, b) = (a?.position, b?.position);
        Some(std::array::from_fn(|c| f64::from(a[c] - b[c])))
    };
    let frames = (0..bvh.frames()).map(position).collect::<Option<Vec<_>>>()?;
    let at = |t: f64| -> [f64; 3] {
        let k = (t as usize).min(frames.len() - 2);
        std::array::from_fn(|c| frames[k][c] + (t - k as f64) * (frames[k + 1][c] - frames[k][c]))
    };
    let count = ((frames.len() - 1) as f64 / rate * 60.0) as usize;
    let all: Vec<f64> = (0..count).flat_map(|k| at(k as f64 / 60.0 * rate)).collect();
    let n = count as f64;
    let variance = |c: usize| {
        let mean = all.iter().skip(c).step_by(3).sum::<f64>() / n;
        all.iter().skip(c).step_by(3).map(|x| (x - mean).powi(2)).sum::<f64>() / n
    };
    let extent = (0..3).map(variance).sum::<f64>().sqrt();
    Some(all.into_iter().map(|x| (x / extent) as f32).collect())
}

/// Gestures of motion capture that are planted into other motions, from half to twice as long and with noise.
pub fn gestures() {
    let files = [
        ("humanoid3d_punch.bvh", "right_elbow", UpAxis::Y, 0.2, 1.4),
        ("cmu_jumping_jacks.bvh", "LeftWrist", UpAxis::Y, 0.5, 1.7),
        ("fair1_jumping.bvh", "RightHand", UpAxis::Z, 1.0, 2.5),
        ("humanoid3d_walk.bvh", "right_ankle", UpAxis::Y, 0.1, 1.1),
        ("humanoid3d_run.bvh", "right_ankle", UpAxis::Y, 0.05, 0.75),
    ];
    let motions: Vec<Vec<f32>> = files.iter().filter_map(|f| joint(f.0, f.1, f.2)).collect();
    if motions.len() < files.len() {
        println!("mocap: not found, skipped");
        return;
    }
    let curve = |values| MotionCurve { rate: 60.0, channels: 3, values, gaps: Vec::new() };
    let mut rng = Rng::new(12);
    for (k, (file, _, _, from, to)) in files.into_iter().enumerate() {
        let own = &motions[k][3 * (60.0 * from) as usize..3 * (60.0 * to) as usize];
        let mut host: Vec<f32> = vec![0.0; 3];
        // Each part goes on where the last ended.
        let mut append = |part: &[f32]| {
            let shift: Vec<f32> = (0..3).map(|c| host[host.len() - 3 + c] - part[c]).collect();
            let start = host.len() / 3;
            host.extend(part.iter().enumerate().map(|(k, x)| x + shift[k % 3]));
            (start as f64 / 60.0, host.len() as f64 / 180.0)
        };
        let mut planted = Vec::new();
        for (n, ratio) in [0.5, 0.7, 1.0, 1.4, 2.0].into_iter().enumerate() {
            append(&motions[(k + 1 + n % 4) % 5]);
            let frames = (own.len() as f64 / 3.0 * ratio) as usize;
            let copy: Vec<f32> = (0..frames)
                .flat_map(|j| {
                    let at = j as f64 * (own.len() / 3 - 1) as f64 / (frames - 1) as f64;
                    let (i, t) = ((at as usize).min(own.len() / 3 - 2), at.fract() as f32);
                    [0, 1, 2].map(|c| own[3 * i + c] + t * (own[3 * i + 3 + c] - own[3 * i + c]))
                })
                .map(|x| x + 0.05 * rng.between(-1.0, 1.0) as f32)
                .collect();
            planted.push(append(&copy));
        }
        append(&motions[(k + 1) % 5]);
        let host = curve(host);
        for threshold in [0.7, 0.8] {
            let rules = QueryRules { threshold, ..QueryRules::default() };
            let found = best_matches(&host, &curve(motions[k].clone()), (from, to), rules, &unmonitored);
            let found = found.unwrap_or_default();
            let is_found = |(a, b): &&(f64, f64)| {
                let overlap =
                    |m: &&MotionMatch| m.to.min(*b) - m.from.max(*a) > 0.6 * (m.to.max(*b) - m.from.min(*a));
                found.iter().any(|m| overlap(&m))
            };
            let right = planted.iter().filter(is_found).count();
            println!(
                "{file}: of 5 planted gestures {right} are found at threshold {threshold}, and {} others",
                found.len() - right
            );
        }
    }
}
