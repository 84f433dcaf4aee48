use super::*;
use crate::core::item::Channels;
use crate::core::standalone::Standalone;
use crate::feature::spectral_flux;
use crate::grain::segmentation::segment;
use crate::grain::segmentation::segments::{cuts, smooth};
use crate::grain::testing::recording;

fn params() -> FluxSegmenterParams {
    FluxSegmenterParams::read(&|_| None).unwrap()
}

/// The cuts of a flux that comes item by item, and the numbers of early joins and splits.
fn streamed(flux: &[f64], len: usize, rules: SegmentRules) -> (Vec<usize>, [u64; 2]) {
    let mut stream = CutStream::new(rules, 0.03);
    let (mut cuts, mut onsets) = (VecDeque::new(), VecDeque::new());
    for (k, f) in flux.iter().enumerate() {
        stream.next(*f as f32);
        // No cut comes later than stated.
        let before = (k * rules.frames.hop).saturating_sub(CutStream::latency(&rules));
        let known = cuts.len();
        stream.take(&mut cuts, &mut onsets);
        assert!(cuts.range(known..).chain(&onsets).all(|cut| *cut >= before || *cut == 0), "{cuts:?}");
        onsets.clear();
    }
    stream.finish(len);
    stream.take(&mut cuts, &mut onsets);
    (cuts.into(), [stream.early_joins, stream.early_splits])
}

#[test]
fn the_cuts_of_recordings_are_those_of_the_whole_recording() {
    let (mut total, mut early) = (0, [0, 0]);
    for name in [
        "scrape_stone_gate.flac",
        "rolling_rail_cart_1.flac",
        "clothing_rustle_1.flac",
        "wood_hit_a1.flac",
        "tabla_tun1.flac",
        "perc_bell.flac",
    ] {
        let (x, rate) = recording(name);
        let rules = SegmentRules::at_rate(f64::from(rate));
        let whole = segment(&x, &rules);
        let (found, counts) = streamed(&whole.flux, x.len(), rules);
        let differ = found.iter().filter(|cut| whole.cuts.binary_search(cut).is_err()).count();
        println!("{name}: {} cuts, {differ} differ, early joins and splits {counts:?}", found.len());
        assert!(differ as u64 <= 8 * (counts[0] + counts[1]), "{name}: {differ} of {}", found.len());
        total += found.len();
        early = [early[0] + counts[0], early[1] + counts[1]];
    }
    assert!(total > 300 && early[0] + early[1] <= 3, "{total} {early:?}");
}

#[test]
fn streamed_segments_partition_and_keep_to_the_lengths() {
    let mut rng = Rng::new(7);
    let (mut exact, mut trials) = (0, 0);
    for trial in 0..600 {
        let len = 1 + rng.below(20_000);
        let min = 2 + rng.below(600);
        let rules = SegmentRules { min, max: 2 * min + rng.below(4000), ..SegmentRules::at_rate(44_100.0) };
        let roughness = rng.uniform();
        let flux: Vec<f64> = (0..len / 128 + 1)
            .map(|k| {
                let quiet = trial % 3 == 0 && (k / 40) % 2 == 0;
                let f = 0.5 + roughness * rng.uniform() + 0.2 * (k as f64 * 0.1).sin();
                f64::from(if quiet { 0.0 } else { f } as f32)
            })
            .collect();
        let (found, early) = streamed(&flux, len, rules);
        assert_eq!((found[0], *found.last().unwrap()), (0, len));
        for pair in found.windows(2) {
            let n = pair[1].checked_sub(pair[0]).unwrap();
            assert!(n > 0 && n <= rules.max && (n >= rules.min || len < rules.min), "{found:?} {rules:?}");
        }
        if early == [0, 0] && trial % 3 > 0 {
            assert_eq!(found, cuts(&smooth(&flux, rules.sigma), len, &rules), "{rules:?}");
            exact += 1;
        }
        trials += usize::from(trial % 3 > 0);
    }
    println!("{exact} of {trials} equal");
    assert!(exact > trials / 2, "{exact} of {trials}");
}

#[test]
fn a_gaussian_bump_is_cut_at_the_joint_standard_deviation() {
    let (centre, width) = (60.0, 6.0_f64);
    let bump: Vec<f64> = (0..121).map(|k| (-0.5 * ((k as f64 - centre) / width).powi(2)).exp()).collect();
    let rules = SegmentRules { max: 1 << 20, ..SegmentRules::at_rate(44_100.0) };
    let (found, _) = streamed(&bump, 121 * 128, rules);
    let offset = (width * width + 4.0_f64).sqrt();
    for frame in [centre - offset, centre + offset] {
        let sample = ((frame - 0.5) * 128.0) as usize;
        // A twentieth of a frame.
        assert!(found.iter().any(|cut| cut.abs_diff(sample) <= 7), "{frame}: {found:?}");
    }
}

#[test]
fn silence_is_cut_after_each_longest_length() {
    let rules = SegmentRules::at_rate(44_100.0);
    let (found, early) = streamed(&vec![0.0; 400], 400 * 128, rules);
    let lengths: Vec<usize> = found.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(lengths[..10].iter().all(|n| (2850..=3000).contains(n)) && early[1] > 10, "{lengths:?}");
}

#[test]
fn the_node_has_the_cuts_and_onsets_at_their_times_in_any_window() {
    let mut rng = Rng::new(3);
    let mut x = vec![0.0_f32; 30_000];
    let times = [6000, 15_000, 22_050];
    for (k, t) in times.iter().enumerate() {
        for (i, y) in x[*t..].iter_mut().take(9000).enumerate() {
            let tone = (0.1 * (k + 1) as f64 * i as f64).sin();
            *y += (0.5 * (-(i as f64) / 1500.0).exp() * (rng.between(-0.3, 0.3) + tone)) as f32;
        }
    }
    x.iter_mut().for_each(|y| *y += rng.between(-1e-4, 1e-4) as f32);
    let rate = Rate::hz(44_100);
    let flux: Vec<f32> =
        spectral_flux(&x, FluxFrames::at_rate(44_100.0)).into_iter().map(|f| f as f32).collect();
    let len = flux.len() * 128;
    let run = |window: usize| {
        let frames = rate.divided_by(128).unwrap();
        let standalone = Standalone::new::<FluxSegmenter>(params());
        let standalone = standalone.input(FluxSegmenterPorts::flux, frames, Channels(1), flux.clone());
        let run = standalone.window(rate.span(window)).run().unwrap();
        let samples = |events: Vec<(Tick, Trigger)>| -> Vec<usize> {
            events.iter().map(|(tick, _)| rate.first_at(*tick) as usize).collect()
        };
        (samples(run.events(FluxSegmenterPorts::cuts)), samples(run.events(FluxSegmenterPorts::onsets)))
    };
    let (found, onsets) = run(4096);
    assert_eq!(run(100), (found.clone(), onsets.clone()));
    let whole: Vec<f64> = flux.iter().map(|f| f64::from(*f)).collect();
    let expected = cuts(&smooth(&whole, 2.0), len, &SegmentRules::at_rate(44_100.0));
    assert_eq!(found, expected);
    // The first attack follows noise, whose flux is as great, and has only a cut.
    assert!(found.iter().any(|cut| cut.abs_diff(times[0]) < 700), "{found:?}");
    for t in &times[1..] {
        assert!(onsets.iter().any(|onset| onset.abs_diff(*t) < 700), "{t}: {onsets:?}");
    }
    assert!(onsets.len() <= 5, "{onsets:?}");
}

#[test]
fn a_longest_length_below_twice_the_shortest_is_refused() {
    let params = FluxSegmenterParams { shortest: 0.05, longest: 0.06, ..params() };
    let standalone = Standalone::new::<FluxSegmenter>(params);
    let standalone = standalone.input(FluxSegmenterPorts::flux, Rate::hz(350), Channels(1), vec![0.0; 10]);
    assert_eq!(standalone.shape().unwrap_err().code, "F150");
}
