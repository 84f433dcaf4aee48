//! Properties of drawings of random graphs.

use super::*;
use foley_nodes::core::random::Rng;

/// A random graph of `count` boxes with links forward, and one that closes a loop.
fn random_drawing(seed: u64, count: usize) -> Drawing {
    let mut rng = Rng::new(seed);
    let kinds = [WireKind::Audio, WireKind::Stream, WireKind::Events, WireKind::Value, WireKind::Fold];
    let mut drawing = Drawing { title: "Random".into(), ..Drawing::default() };
    for b in 0..count {
        let inputs = if b == 0 { 0 } else { rng.below(4) };
        let outputs = 1 + rng.below(2);
        drawing.boxes.push(NodeBox {
            rank: 0,
            id: format!("node_{b}"),
            type_name: ["Gain", "ContactDetector", "FrictionModelFromClips"][rng.below(3)].into(),
            inputs: (0..inputs).map(|k| (format!("input_{k}"), true)).collect(),
            outputs: (0..outputs)
                .map(|k| OutPort {
                    name: format!("out_{k}"),
                    label: if rng.below(2) == 0 { "48000 Hz, stereo".into() } else { String::new() },
                    kind: kinds[rng.below(5)],
                })
                .collect(),
        });
        for port in 0..inputs {
            // Mostly from a near box, sometimes from any.
            let near = b - 1 - rng.below(b.min(5));
            let from = if rng.below(5) == 0 { rng.below(b) } else { near };
            let out = rng.below(drawing.boxes[from].outputs.len());
            drawing.wires.push(Wire { from: (from, out), to: (b, port), back: false });
        }
    }
    if let Some(to) = drawing.boxes.iter().position(|b| !b.inputs.is_empty()) {
        drawing.wires.push(Wire { from: (count - 1, 0), to: (to, 0), back: true });
    }
    drawing
}

#[test]
fn boxes_do_not_overlap_and_lie_inside() {
    for seed in 0..60 {
        let drawing = random_drawing(seed, 3 + seed as usize);
        let coordinates = assign_coordinates(&drawing);
        for (a, r) in coordinates.boxes.iter().enumerate() {
            assert!(r.x >= 0.0 && r.y >= 0.0, "{seed}: {r:?}");
            assert!(r.x + r.w <= coordinates.width && r.y + r.h <= coordinates.height, "{seed}: {r:?}");
            for q in &coordinates.boxes[..a] {
                let apart = r.x + r.w < q.x || q.x + q.w < r.x || r.y + r.h < q.y || q.y + q.h < r.y;
                assert!(apart, "{seed}: {r:?} and {q:?}");
            }
        }
    }
}

#[test]
fn links_run_from_port_to_port_and_past_all_other_boxes() {
    for seed in 0..60 {
        let drawing = random_drawing(seed, 3 + seed as usize);
        let coordinates = assign_coordinates(&drawing);
        for (wire, points) in drawing.wires.iter().zip(&coordinates.wires) {
            let (from, to) = (coordinates.boxes[wire.from.0], coordinates.boxes[wire.to.0]);
            assert_eq!(points[0].0, from.x + from.w);
            assert_eq!(points[points.len() - 1].0, to.x);
            for pair in points.windows(2) {
                // A link changes height between two columns, and is horizontal elsewhere.
                let (left, right) = (pair[0].0.min(pair[1].0), pair[0].0.max(pair[1].0));
                let (top, bottom) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
                for (b, r) in coordinates.boxes.iter().enumerate() {
                    let ends = b == wire.from.0 || b == wire.to.0;
                    let inside = left < r.x + r.w && right > r.x && top < r.y + r.h && bottom > r.y;
                    assert!(ends || !inside, "{seed}: {wire:?} through box {b}: {pair:?} {r:?}");
                }
            }
        }
    }
}

#[test]
fn every_link_goes_to_a_later_layer() {
    for seed in 0..20 {
        let drawing = random_drawing(seed, 30);
        let coordinates = assign_coordinates(&drawing);
        for wire in drawing.wires.iter().filter(|w| !w.back) {
            let (from, to) = (coordinates.boxes[wire.from.0], coordinates.boxes[wire.to.0]);
            assert!(from.x + from.w < to.x);
        }
    }
}

#[test]
fn sweeps_remove_all_crossings_of_a_ladder_in_reverse_order() {
    let one = |id: String, inputs: usize| NodeBox {
        rank: 0,
        id,
        type_name: "Gain".into(),
        inputs: (0..inputs).map(|_| ("audio".to_owned(), true)).collect(),
        outputs: vec![OutPort { name: "out".into(), label: String::new(), kind: WireKind::Audio }],
    };
    let mut drawing = Drawing::default();
    for k in 0..5 {
        drawing.boxes.push(one(format!("source{k}"), 0));
    }
    for k in 0..5 {
        drawing.boxes.push(one(format!("sink{k}"), 1));
        drawing.wires.push(Wire { from: (4 - k, 0), to: (5 + k, 0), back: false });
    }
    assert_eq!(layers::Layers::of(&drawing).crossings(), 0);
}

#[test]
fn the_same_graph_gives_the_same_text() {
    for seed in 0..5 {
        assert_eq!(svg(&random_drawing(seed, 30)), svg(&random_drawing(seed, 30)));
    }
}

#[test]
fn texts_are_escaped_and_truncated() {
    let mut drawing = random_drawing(1, 3);
    drawing.title = "<script>&\"'\u{1}".into();
    drawing.boxes[0].id = "x".repeat(200);
    let text = svg(&drawing);
    assert!(text.contains("&lt;script&gt;&amp;&quot;&#39; "), "{text}");
    assert!(!text.contains("<script>"));
    assert!(text.contains(&format!(">{}…<", "x".repeat(43))));
}

#[test]
fn an_empty_graph_is_an_empty_drawing() {
    let text = svg(&Drawing::default());
    assert!(text.starts_with("<svg ") && text.ends_with("</svg>\n"));
}
