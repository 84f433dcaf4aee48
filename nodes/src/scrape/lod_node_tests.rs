use super::*;
use crate::core::solo::Solo;
use crate::core::time::ticks;
use crate::scrape::testing::piece;

fn params() -> LodSelectParams {
    LodSelectParams::read(&|_| None).unwrap()
}

/// Gains of a contact on the four levels at a time.
fn gains(parts: &[Vec<(Tick, PathPiece)>; LEVELS], time: f64) -> [f64; LEVELS] {
    let tick = ticks(time);
    std::array::from_fn(|level| {
        let now = parts[level].iter().rev().find(|(from, p)| (*from..from + p.duration).contains(&tick));
        now.map_or(0.0, |(from, p)| p.gain_at((tick - from) as f64 / p.duration as f64))
    })
}

#[test]
fn edits_while_it_sounds_cross_fade() {
    let frame = 1.0 / 60.0;
    let pieces: Vec<_> = (0..90)
        .map(|k| {
            let t = f64::from(k) * frame;
            (ticks(t), piece([t, 0.0], [1.0, 0.0], frame))
        })
        .collect();
    let start = LodSelectParams { distance: 3.0, ..params() };
    let edits = [
        (LodSelectParams { distances: [1.0, 15.0, 40.0, 100.0], ..start.clone() }, 1),
        (LodSelectParams { distance: 20.0, ..start.clone() }, 2),
        (LodSelectParams { distance: 60.0, hysteresis: 0.0, ..start.clone() }, 3),
        (LodSelectParams { budget: Some(20.0), ..start.clone() }, 2),
    ];
    for (edit, level) in edits {
        let solo =
            Solo::new::<LodSelect>(start.clone()).events(LodSelectPorts::paths, pieces.clone(), ticks(1.5));
        let mut run = solo.window(ticks(0.01)).start().unwrap();
        let mut count = 0;
        while run.step().unwrap() {
            count += 1;
            if count == 60 {
                assert_eq!(run.node().retune(&edit), Retune::Done);
            }
        }
        let parts = [
            run.events(LodSelectPorts::full),
            run.events(LodSelectPorts::split),
            run.events(LodSelectPorts::noise),
            run.events(LodSelectPorts::spectrum),
        ];
        assert!(gains(&parts, 0.5)[0] == 1.0 && gains(&parts, 1.4)[level] == 1.0, "{edit:?}");
        let mut before = gains(&parts, 0.4);
        for k in 401..1400 {
            let now = gains(&parts, f64::from(k) * 1e-3);
            let power: f64 = now.iter().map(|g| g * g).sum();
            assert!((power - 1.0).abs() < 0.02, "{k} ms: {now:?}");
            for (a, b) in now.iter().zip(before) {
                assert!((a - b).abs() < 0.04, "{k} ms: {before:?} {now:?}");
            }
            before = now;
        }
    }
}
