use super::*;
use crate::core::item::Data;
use crate::core::standalone::Standalone;

fn params() -> GrainRecordingsParams {
    GrainRecordingsParams { rate: Rate::hz(8000), ..GrainRecordingsParams::read(&|_| None).unwrap() }
}

#[test]
fn continuous_recordings_are_split_into_parts_that_add_up() {
    let mut rng = Rng::new(1);
    let rub: Vec<f32> =
        (0..8000).map(|i| (0.3 * (0.3 * f64::from(i)).sin() + rng.between(-0.1, 0.1)) as f32).collect();
    let whole = Part { component: Component::Whole, channels: vec![rub.clone()] };
    let parts = split_part(&params(), &whole);
    assert_eq!(
        parts.iter().map(|p| p.component).collect::<Vec<_>>(),
        [Component::Steady, Component::Transient]
    );
    let sums = parts[0].channels[0].iter().zip(&parts[1].channels[0]).map(|(a, b)| a + b);
    assert!(rub.iter().zip(sums).all(|(x, y)| (x - y).abs() < 1e-6));
}

#[test]
fn trials_have_words_of_file_names_or_of_the_manifest() {
    for seed in 0..6 {
        let (p, files) = GrainRecordingsNode::trial(&mut Rng::new(seed));
        let from_list = p.manifest.is_none();
        let mut standalone = Standalone::func::<GrainRecordingsNode>(p);
        standalone.files = files;
        let run = standalone.run().unwrap();
        let value = run.value(0).unwrap();
        let recordings: &GrainRecordings = value.get().unwrap();
        assert_eq!(recordings.recordings[0].tags[0], if from_list { "knock" } else { "wood" });
        assert_eq!(recordings.recordings[0].kind, SourceKind::Impulsive);
        assert_eq!(recordings.recordings[1].kind, SourceKind::Continuous);
        assert_eq!(recordings.recordings[0].len(), 3000);
    }
    assert!(GrainRecordings::trial(&mut Rng::new(1)).recordings.len() > 1);
}
