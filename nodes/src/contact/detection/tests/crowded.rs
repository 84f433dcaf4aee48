//! Frames in which everything is in one place.

use super::grid;
use crate::contact::{Contact, Detection, Detector, DetectorParams};
use crate::core::pool::with_threads;

#[test]
fn a_frame_with_all_vertices_in_one_place_has_no_contacts_and_those_around_it_do() {
    crowded_frames();
    with_threads(crowded_frames);
}

fn crowded_frames() {
    let sheet = grid(50, 0.02, 0.0);
    let params = DetectorParams { radius: 0.03, ..DetectorParams::default() };
    let mut detector = Detector::new(&sheet, &[], params).unwrap();
    let mut out = vec![Contact::default(); sheet.vertex_count()];
    // Folded in half, 1 cm apart.
    let folded: Vec<_> = sheet
        .rest
        .iter()
        .map(|&[x, y, _]| if x > 0.49 { [0.98 - x, y, 0.01] } else { [x, y, 0.0] })
        .collect();
    let expected = detector.detect(&folded, &[], &mut out).unwrap();
    let folded_out = out.clone();
    assert!(expected.contacts > 1000 && !expected.crowded);
    // In one point, and nearly so: the search would measure 12 million pairs.
    for spread in [0.0, 1e-7, 1e-4] {
        let jitter = |k: usize| spread * ((k as f32 * 78.233).sin() * 437.5).fract();
        let collapsed: Vec<_> = (0..sheet.vertex_count())
            .map(|k| [jitter(3 * k), jitter(3 * k + 1), jitter(3 * k + 2)])
            .collect();
        for _ in 0..2 {
            let found = detector.detect(&collapsed, &[], &mut out).unwrap();
            assert!(found.crowded && found.contacts == 0, "{spread}: {found:?}");
            assert!(out.iter().all(|contact| *contact == Contact::default()));
        }
        let again = detector.detect(&folded, &[], &mut out).unwrap();
        assert_eq!(Detection { rebuilt: 0, ..again }, Detection { rebuilt: 0, ..expected });
        assert_eq!(out, folded_out);
    }
}
