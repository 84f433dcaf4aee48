//! Defaults of nodes that make sound from images, from their specification. A change of a default changes all graphs that omit it.

use foley_nodes::core::params::Datum::{self, Bool, Float, Int, List};
use foley_nodes::registry::all;

fn name(text: &str) -> Datum {
    Datum::Name(text.into())
}

#[test]
fn nodes_of_textures_have_the_specified_defaults() {
    let half = || Float(0.5);
    let table = [
        (
            "ImageLuma",
            vec![
                ("kind", name("Lstar")),
                ("density", Float(512.0)),
                ("depth", Float(1e-4)),
                ("wrap", name("Repeat")),
            ],
        ),
        ("HistogramClass", vec![("threshold", Float(0.5)), ("stretch", Bool(true)), ("class", name("Auto"))]),
        ("SobelMap", vec![("pre_blur", Float(0.0))]),
        ("MapCoder", vec![("coding", name("Signed"))]),
        (
            "Isophotes",
            vec![
                ("count", Int(8)),
                ("spacing", name("Quantile")),
                ("pre_blur", Float(1.0)),
                ("saddle", name("Decider")),
                ("simplify", Float(0.25)),
                ("gradient_error", Float(0.05)),
            ],
        ),
        ("Bilateral", vec![("sigma_d", Float(3.0)), ("sigma_r", Float(4.25)), ("passes", Int(1))]),
        (
            "DogFeatures",
            vec![
                ("sigma_e", Float(1.0)),
                ("ratio", Float(1.6_f64.sqrt())),
                ("tau", Float(0.998)),
                ("phi_e", Float(4.0)),
            ],
        ),
        ("FeatureNoiseSplit", vec![("mask_features", Bool(true))]),
        (
            "NoiseProfile",
            vec![
                ("code", name("Profile")),
                ("samples", Int(8192)),
                ("extend", Bool(true)),
                ("v_max", Float(2.0)),
            ],
        ),
        (
            "ContactPath",
            vec![
                ("mode", name("Hermite")),
                ("guard", Bool(true)),
                ("teleport", Float(8.0)),
                ("density", Float(512.0)),
            ],
        ),
        (
            "MapExcitation",
            vec![
                ("a", Float(1.0)),
                ("b", Float(0.0)),
                ("kappa", Float(1.0)),
                ("value", name("Directional")),
                ("interp", name("Bspline3")),
            ],
        ),
        (
            "IsophoteExcitation",
            vec![
                ("reading", name("Crossing")),
                ("width", Float(1.0)),
                ("radius", Float(2.0)),
                ("a", Float(1.0)),
                ("b", Float(0.0)),
            ],
        ),
        ("NoiseExcitation", vec![("a", half()), ("b", half()), ("interp", name("Sinc32"))]),
        (
            "ImpactForce",
            vec![
                ("law", name("Hertz")),
                ("tau", Float(1e-3)),
                ("energy_ref", Float(0.1)),
                ("hardness_ref", Float(1.0)),
                ("shape", name("Cosine")),
                ("micro", Int(0)),
            ],
        ),
        ("ModalBank", vec![("gain", Float(1.0)), ("cull", Float(-80.0))]),
        ("ModalFromRecording", vec![("count", Int(64))]),
        (
            "LodSelect",
            vec![
                ("distances", List([5.0, 15.0, 40.0, 100.0].map(Float).to_vec())),
                ("hysteresis", Float(0.1)),
            ],
        ),
        ("TwoTextures", vec![("taps", Int(33)), ("radius", Float(0.02))]),
    ];
    let nodes = all();
    for (node, defaults) in table {
        let params = (nodes.iter().find(|ty| ty.name == node).unwrap().params)();
        for (field, expected) in defaults {
            let found =
                params.iter().find(|p| p.name == field).unwrap_or_else(|| panic!("{node} has no `{field}`"));
            let same = match (&found.default, &expected) {
                // Some are stored in single precision.
                (Some(Float(a)), Float(b)) => (a - b).abs() <= 1e-6 * b.abs(),
                (a, b) => a.as_ref() == Some(b),
            };
            assert!(same, "`{node}.{field}` is {:?}, not {expected:?}", found.default);
        }
    }
}
