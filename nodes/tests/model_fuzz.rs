//! Damaged friction models end in an error or in finite sound, never in a panic or in memory without bound.

use foley_nodes::core::item::{AnyValue, Data};
use foley_nodes::core::random::Draw;
use foley_nodes::core::solo::Solo;
use foley_nodes::friction::FrictionModel;
use foley_nodes::friction::model_nodes::{FrictionModelFile, FrictionModelFileParams};

/// One change to a text: a byte flipped, a run cut out or doubled, a number made extreme.
fn damage(text: &mut Vec<u8>, draw: &mut Draw) {
    let at = draw.below(text.len());
    match draw.below(5) {
        0 => text[at] ^= 1 << draw.below(7),
        1 => drop(text.drain(at..(at + 1 + draw.below(40)).min(text.len()))),
        2 => {
            let piece = text[at..(at + 1 + draw.below(40)).min(text.len())].to_vec();
            text.splice(at..at, piece);
        }
        _ => {
            let digit = (0..text.len()).cycle().skip(at).take(text.len()).find(|&k| text[k].is_ascii_digit());
            let Some(start) = digit else { return };
            let number = |b: &u8| b.is_ascii_digit() || b".eE+-".contains(b);
            let end = start + text[start..].iter().take_while(|b| number(b)).count();
            let extremes = ["0", "-1", "1e300", "1e-300", "1e39", "18446744073709551615", "null"];
            text.splice(start..end, extremes[draw.below(extremes.len())].bytes());
        }
    }
}

#[test]
fn damaged_models_are_refused_or_stay_finite() {
    let mut draw = Draw::new(5);
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..3000 {
        let value = AnyValue::new(FrictionModel::trial(&mut draw));
        let mut text = (value.kind().json)(&value).to_string().into_bytes();
        for _ in 0..1 + draw.below(3) {
            damage(&mut text, &mut draw);
        }
        let mut solo = Solo::func::<FrictionModelFile>(FrictionModelFileParams { path: "m.json".into() });
        solo.files.insert("m.json", text);
        match solo.run() {
            Ok(run) => {
                let value = run.value(0).expect("a run that succeeds gives its value");
                let model = value.get::<FrictionModel>().expect("the value is a model");
                assert!(model.power(0.5).is_finite() && model.power(1e9).is_finite());
                taken += 1;
            }
            Err(fault) => {
                assert_eq!(fault.code, "F076", "{fault}");
                refused += 1;
            }
        }
    }
    assert!(taken > 50 && refused > 500, "{taken} taken, {refused} refused");
}
