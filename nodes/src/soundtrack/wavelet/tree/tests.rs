use super::*;

fn recording(name: &str, channels: Vec<Vec<f32>>) -> TreeRecording {
    TreeRecording { name: name.into(), content: String::new(), channels }
}

fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Rng::new(seed);
    (0..n).map(|_| rng.between(-1.0, 1.0) as f32).collect()
}

fn analysed(x: &[f32], fit: TreeFit, block: Option<f64>) -> WaveletTree {
    let rules = TreeRules { fit, block, ..TreeRules::default() };
    WaveletTree::analyse(8000.0, &[recording("a", vec![x.to_vec()])], &rules).unwrap()
}

#[test]
fn every_fit_restores_the_recording() {
    let x = noise(5000, 1);
    for (fit, samples, from) in
        [(TreeFit::Trim, 4608, 0), (TreeFit::PadReflect, 5000, 0), (TreeFit::Circular, 4608, 160)]
    {
        let tree = analysed(&x, fit, Some(0.065));
        assert_eq!((tree.depth, tree.validate()), (9, Ok(())));
        let audio = tree.audio(0, 0);
        for k in from..samples {
            assert!((audio[k] - x[k]).abs() < 1e-5, "{fit:?} {k}: {} {}", audio[k], x[k]);
        }
    }
}

#[test]
fn a_circular_recording_has_no_step_where_it_wraps() {
    let x: Vec<f32> = (0..5000).map(|k| (0.01 * k as f32).sin() + 0.0001 * k as f32).collect();
    let audio = analysed(&x, TreeFit::Circular, Some(0.065)).audio(0, 0);
    let step = (audio[0] - audio[audio.len() - 1]).abs();
    assert!(step < 0.02, "{step}");
    let trimmed = analysed(&x, TreeFit::Trim, Some(0.065)).audio(0, 0);
    assert!((trimmed[0] - trimmed[trimmed.len() - 1]).abs() > 0.2);
}

#[test]
fn roots_span_half_a_second_or_an_eighth_of_the_recording() {
    assert_eq!(analysed(&noise(5000, 1), TreeFit::Circular, None).depth, 9);
    assert_eq!(analysed(&noise(100_000, 1), TreeFit::Circular, None).depth, 11);
    assert_eq!(analysed(&noise(16, 1), TreeFit::Circular, None).depth, 1);
}

#[test]
fn recordings_follow_each_other_and_padding_is_masked() {
    let rules = TreeRules { fit: TreeFit::PadReflect, block: Some(0.065), ..TreeRules::default() };
    let recordings = [
        recording("a", vec![noise(1000, 1), noise(1000, 2)]),
        recording("b", vec![noise(1536, 3), noise(1536, 4)]),
    ];
    let tree = WaveletTree::analyse(8000.0, &recordings, &rules).unwrap();
    let roots: Vec<_> = tree.sources.iter().map(|s| (s.first, s.roots)).collect();
    assert_eq!(roots, [(0, 2), (2, 3)]);
    assert_eq!((0..5).map(|root| tree.source_of(root)).collect::<Vec<_>>(), [0, 0, 1, 1, 1]);
    assert_eq!(
        (0..5).map(|root| tree.is_masked(0, root)).collect::<Vec<_>>(),
        [false, true, false, false, false]
    );
    // 1000 samples are 500 leaves; the first recording has 512.
    assert!(!tree.is_masked(8, 499) && tree.is_masked(8, 500) && !tree.is_masked(8, 512));
    assert_eq!(tree.details[3].len(), 5 * 8 * 2);
}

#[test]
fn recordings_that_do_not_fit_are_named() {
    let short = WaveletTree::analyse(8000.0, &[recording("s", vec![noise(15, 1)])], &TreeRules::default());
    assert_eq!(short.unwrap_err().to_string(), "\"s\" has 15 samples; at least 16 are needed");
    let rules = TreeRules { block: Some(1.0), ..TreeRules::default() };
    let short = WaveletTree::analyse(8000.0, &[recording("s", vec![noise(4000, 1)])], &rules);
    assert_eq!(short.unwrap_err().to_string(), "\"s\" has 4000 samples; at least 4256 are needed");
    let mixed = [recording("a", vec![noise(99, 1)]), recording("b", vec![noise(99, 1), noise(99, 2)])];
    let e = WaveletTree::analyse(8000.0, &mixed, &TreeRules::default()).unwrap_err();
    assert_eq!(e.to_string(), "\"b\" has 2 channels; the first recording has 1");
    assert_eq!(WaveletTree::analyse(8000.0, &[], &TreeRules::default()), Err(TreeError::Empty));
}

#[test]
fn a_constant_recording_has_no_details() {
    let tree = analysed(&vec![0.3; 3000], TreeFit::Circular, None);
    let inner = &tree.details[tree.depth as usize - 1];
    assert!(inner[200..inner.len() - 8].iter().all(|d| *d == 0.0));
}
