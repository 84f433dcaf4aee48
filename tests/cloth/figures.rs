//! The figures of the cloth paper, drawn by the commands in the book, have the content of the paper's figures.

use crate::common::figure::{commands, heights, labels, mean, numbers, run, values};

/// The drawing of a figure, by the command beside its number in the book.
fn figure(number: &str) -> String {
    part_of_figure(number, 0)
}

/// The drawing of a part of a figure.
fn part_of_figure(number: &str, part: usize) -> String {
    let commands = commands(include_str!("../../docs/src/cloth.md"), number);
    run(&commands[part]).swap_remove(0)
}

/// Spectra of friction: a line for each speed, the faster the louder.
fn spectra(svg: &str) -> Vec<f64> {
    let speeds: Vec<f64> = labels(svg, " m/s").iter().map(|speed| speed.parse().unwrap()).collect();
    let lines = heights(svg);
    assert_eq!(lines.len(), speeds.len());
    assert!(speeds.is_sorted_by(|a, b| a < b), "{speeds:?}");
    assert!(lines.iter().all(|line| line.len() > 100));
    let levels: Vec<f64> = lines.iter().map(|line| mean(line)).collect();
    assert!(levels[0] + 30.0 < *levels.last().unwrap(), "faster is louder: {levels:?}");
    assert!(svg.contains("frequency, Hz") && svg.contains("power density"));
    speeds
}

#[test]
fn figure_3_has_a_spectrum_for_every_measured_speed() {
    assert!(spectra(&figure("3")).len() >= 6);
}

/// First and last bin of a line of a spectrum that are within a fifth of the height of the drawing of its top.
fn band(line: &[f64]) -> (usize, usize) {
    let top = line.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let bottom = line.iter().copied().fold(f64::INFINITY, f64::min);
    let inside = |y: &f64| *y > top - 0.2 * (top - bottom);
    (line.iter().position(inside).unwrap(), line.iter().rposition(inside).unwrap())
}

#[test]
fn figure_5_has_a_line_that_moves_between_speeds_and_both_at_once_in_a_crossfade() {
    let commands = commands(include_str!("../../docs/src/cloth.md"), "5");
    let drawn = run(&commands[0]);
    let [moved, crossfaded] =
        [0, 1].map(|k| heights(&drawn[k]).iter().map(|line| band(line)).collect::<Vec<_>>());
    for svg in &drawn {
        let speeds: Vec<f64> = labels(svg, " m/s").iter().map(|speed| speed.parse().unwrap()).collect();
        assert_eq!(speeds, [0.3, 0.4, 0.5, 0.6]);
    }
    // By displacement both edges rise with speed; a crossfade starts where the slower line does and ends where the faster one does.
    assert!(moved.windows(2).all(|pair| pair[0].0 < pair[1].0 && pair[0].1 < pair[1].1), "{moved:?}");
    let wide = crossfaded.iter().zip(&moved).filter(|(a, b)| a.1 - a.0 > (b.1 - b.0) * 13 / 10).count();
    assert!(wide >= 2, "{moved:?} {crossfaded:?}");
}

#[test]
fn figure_6_has_the_vertices_that_buckle_in_three_frames() {
    let svg = figure("6");
    let counts: Vec<usize> = labels(&svg, " inwards (blue)")
        .iter()
        .flat_map(|text| {
            let words: Vec<&str> = text.split(' ').collect();
            [words[2].parse().unwrap(), words[words.len() - 1].parse().unwrap()]
        })
        .collect();
    assert!(counts.len() == 6 && counts.iter().all(|count| *count > 10), "{counts:?}");
    let dots = |colour| values(&svg, "circle", colour, "fill").len();
    let reported = |side: usize| counts.iter().skip(side).step_by(2).sum::<usize>();
    assert_eq!([dots("#b2182b"), dots("#2166ac")], [reported(0), reported(1)]);
    assert_eq!(values(&svg, "path", "", "d").len(), 3, "the mesh under each");
}

#[test]
fn figure_8_has_every_extracted_event_in_its_recording() {
    let svg = figure("8");
    let title = labels(&svg, " s").into_iter().find(|text| text.contains("samples of")).unwrap();
    let reported: usize = title.split(' ').next().unwrap().parse().unwrap();
    let (from, width) = (
        numbers(&svg, "rect", "class=\"sample\"", " x"),
        numbers(&svg, "rect", "class=\"sample\"", " width"),
    );
    assert!(reported >= 30 && from.len() == reported, "{title}");
    assert!(from.iter().zip(&width).all(|(x, width)| *x >= 12.0 && *width > 0.0 && x + width <= 949.0));
    assert_eq!(values(&svg, "polygon", "", "points").len(), 4, "the waveform of each recording");
}

#[test]
fn figure_10_has_three_features_of_target_and_choice_that_go_together() {
    let svg = figure("10");
    for dim in 0..3 {
        assert!(svg.contains(&format!(">target {dim}<")) && svg.contains(&format!(">chosen {dim}<")));
    }
    let lines = heights(&svg);
    assert!(lines.len() == 6 && lines.iter().all(|line| line.len() == lines[0].len() && line.len() > 1000));
    let (target, chosen) = (&lines[0], &lines[1]);
    let (a, b) = (mean(target), mean(chosen));
    let product = |x: &[f64], m: f64, y: &[f64], n: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - m) * (y - n)).sum()
    };
    let correlation = product(target, a, chosen, b)
        / (product(target, a, target, a) * product(chosen, b, chosen, b)).sqrt();
    assert!(correlation > 0.8, "loudness of both: {correlation}");
}

#[test]
fn figure_11_has_both_worlds_before_and_after_the_warp_that_brings_them_together() {
    let svg = part_of_figure("11", 1);
    assert!(svg.contains("Before the warp") && svg.contains("After the warp"));
    let [target, database] = ["#2166ac", "#bbb"].map(|colour| numbers(&svg, "circle", colour, "cx"));
    assert!(target.len() == 800 && database.len() > 400 && database.len() % 2 == 0);
    let apart = |half: usize| {
        let part = |x: &[f64]| mean(&x[half * x.len() / 2..][..x.len() / 2]);
        (part(&target) - part(&database)).abs()
    };
    assert!(apart(1) < 0.5 * apart(0), "loudness: {} before, {} after", apart(0), apart(1));
    // The lines of pairs lead from the warped target to the database.
    let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(|end| numbers(&svg, "line", "#e66101", end));
    let long = |k: usize| (x2[k] - x1[k]).hypot(y2[k] - y1[k]);
    let half = x1.len() / 2;
    let [before, after] = [0..half, half..2 * half].map(|all| all.map(long).sum::<f64>() / half as f64);
    assert!(half > 50 && after < 0.3 * before, "pairs {before} apart, then {after}");
}

#[test]
fn figure_11_has_both_waveforms_with_their_correspondences() {
    let svg = part_of_figure("11", 0);
    assert!(svg.contains("Target") && svg.contains("Recordings"));
    let set = include_str!("../../graphs/assets/cloth/sheet.correspondences.ron");
    let pairs = set.matches("duration: ").count();
    let marks = svg.matches("fill-opacity=\"0.25\"").count();
    assert!(pairs > 4 && marks == 2 * pairs, "{marks} marks of {pairs} correspondences");
    assert!(heights(&svg).iter().all(|line| line.len() > 1000), "two waveforms");
}
