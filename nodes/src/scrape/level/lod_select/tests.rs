use super::*;
use crate::core::standalone::{Feed, Standalone};
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
        let standalone = Standalone::new::<LodSelect>(start.clone()).events(
            LodSelectPorts::paths,
            pieces.clone(),
            ticks(1.5),
        );
        let mut run = standalone.window(ticks(0.01)).start().unwrap();
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

/// The levels on which a contact sounds one second after it began.
fn rendered(standalone: Standalone, contact: u64) -> [bool; LEVELS] {
    let run = standalone.window(ticks(0.01)).run().unwrap();
    let all = [LodSelectPorts::full, LodSelectPorts::split, LodSelectPorts::noise, LodSelectPorts::spectrum];
    all.map(|port| {
        let late = ticks(1.0);
        run.events(port).iter().any(|(from, p)| *from > late && p.contact == contact && p.gain[0] == 1.0)
    })
}

#[test]
fn a_nearer_contact_has_the_finer_level() {
    let frame = 1.0 / 60.0;
    // Contacts 1 and 2 with bodies 3 and 4, one near the listener and one 20 m away; a third contact of both bodies has
    // no report.
    let far = |contact: u64| if contact == 2 { 20.0 } else { 1.0 };
    let mut rng = Rng::new(4);
    let blank = <ContactState as crate::core::item::Event>::trial(&mut rng);
    let (mut states, mut pieces) = (Vec::new(), Vec::new());
    for k in 0..90 {
        let t = f64::from(k) * frame;
        for contact in [1, 2] {
            let (bodies, point) = ([0, 2 + contact as u32], [far(contact), t, 0.0]);
            let frame = crate::rigid::ContactFrame { contact, bodies, point, ..blank.frame };
            states.push((ticks(t), ContactState { frame, ..blank }));
        }
        for contact in [1, 2, 9, PathPiece::pair([0, 3]), PathPiece::pair([0, 4])] {
            pieces.push((ticks(t), PathPiece { contact, ..piece([t, 0.0], [1.0, 0.0], frame) }));
        }
    }
    let standalone = |listener: [f64; 3]| {
        let p = LodSelectParams { listener, distance: 8.0, ..params() };
        Standalone::new::<LodSelect>(p)
            .events(LodSelectPorts::paths, pieces.clone(), ticks(1.5))
            .feed(LodSelectPorts::contacts_at.index(), Feed::events(states.clone(), ticks(1.5)))
    };
    let (full, split, noise) =
        ([true, false, false, false], [false, true, false, false], [false, false, true, false]);
    for (near, away) in [(1, 2), (PathPiece::pair([0, 3]), PathPiece::pair([0, 4]))] {
        assert_eq!(rendered(standalone([0.0; 3]), near), full);
        assert_eq!(rendered(standalone([0.0; 3]), away), noise);
        // A listener beside the other contact receives that contact on the full level.
        assert_eq!([near, away].map(|c| rendered(standalone([20.0, 0.0, 0.0]), c)), [noise, full]);
    }
    assert_eq!(
        rendered(standalone([0.0; 3]), 9),
        split,
        "of whom no position is known has the distance of all"
    );
}
