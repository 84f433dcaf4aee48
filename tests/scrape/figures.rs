//! The figures of Picard, Tsingos and Faure (2008), drawn by the commands in the book, have the content of the paper's
//! figures.

use crate::common::figure::{commands, heights, labels, mean, numbers, run, values};
use foley_nodes::texture::decode::{Samples, decode};

const BOOK: &str = include_str!("../../docs/src/texture.md");

/// All files of a figure.
fn figure(row: &str) -> Vec<String> {
    commands(BOOK, row).iter().flat_map(|command| run(command)).collect()
}

/// The bytes of an image within a drawing, row by row, and the number of bytes in a row.
fn picture(svg: &str) -> (Vec<f64>, usize) {
    let text = svg.split("base64,").nth(1).unwrap().split('"').next().unwrap();
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |c: u8| digits.iter().position(|d| *d == c);
    let six: Vec<usize> = text.bytes().filter_map(digit).collect();
    let bytes = |four: &[usize]| {
        let all = four.iter().fold(0, |all, six| all << 6 | six) << (6 * (4 - four.len()));
        [16, 8, 0].map(|shift| (all >> shift) as u8).into_iter().take(four.len() * 3 / 4).collect::<Vec<_>>()
    };
    let png: Vec<u8> = six.chunks(4).flat_map(bytes).collect();
    let picture = decode(&png).unwrap();
    let Samples::Bytes(samples) = picture.samples else { panic!("8 bits") };
    assert_eq!(samples.len(), picture.width * picture.height, "one channel");
    (samples.into_iter().map(f64::from).collect(), picture.width)
}

fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let (m, n) = (mean(x), mean(y));
    let product = |x: &[f64], m: f64, y: &[f64], n: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - m) * (y - n)).sum()
    };
    product(x, m, y, n) / (product(x, m, x, m) * product(y, n, y, n)).sqrt()
}

#[test]
fn figure_2_has_a_broad_histogram_of_a_complex_texture_and_a_narrow_one_of_a_simple_one() {
    let drawings = figure("2");
    let bars: Vec<Vec<f64>> = drawings.iter().map(|svg| numbers(svg, "rect", "#2166ac", " height")).collect();
    assert!(drawings[0].contains("(complex; simple below 0.2)") && drawings[1].contains("(simple; simple"));
    // Number of tones with more than a twentieth of the most frequent one.
    let broad = bars.iter().map(|bars| {
        let most = bars.iter().fold(0.0_f64, |most, bar| most.max(*bar));
        bars.iter().filter(|bar| **bar > 0.05 * most).count()
    });
    let broad: Vec<usize> = broad.collect();
    assert!(broad[0] > 100 && (1..5).contains(&broad[1]), "{broad:?} tones");
}

#[test]
fn figure_3_has_an_image_and_bright_lines_where_it_changes() {
    let drawings = figure("3");
    let ((image, width), (map, same)) = (picture(&drawings[0]), picture(&drawings[1]));
    assert_eq!((width, image.len()), (same, map.len()));
    // Central differences in the middle of the image.
    let inside = (0..image.len())
        .filter(|k| *k > width && *k < image.len() - width && k % width > 0 && k % width < width - 1);
    let change = |k: usize| {
        let [x, y] = [image[k + 1] - image[k - 1], image[k + width] - image[k - width]];
        x.hypot(y)
    };
    let (changes, bright): (Vec<f64>, Vec<f64>) = inside.map(|k| (change(k), map[k])).unzip();
    let found = correlation(&changes, &bright);
    assert!(found > 0.9, "{found}");
}

#[test]
fn figure_4_has_curves_of_eight_levels_that_are_mostly_closed() {
    let svg = &figure("4")[0];
    let levels = numbers(svg, "path", "data-level", "data-level");
    assert!(levels.len() == 8 && levels.is_sorted_by(|a, b| a < b), "{levels:?}");
    for (level, path) in levels.iter().zip(values(svg, "path", "data-level", " d")) {
        let (curves, closed) = (path.matches('M').count(), path.matches('Z').count());
        assert!(curves > 100 && closed > curves / 2, "{level}: {closed} of {curves} are closed");
    }
}

#[test]
fn figure_5_has_few_dark_features_and_noise_that_leaves_them_out() {
    let drawings = figure("5");
    let ((features, _), (noise, _)) = (picture(&drawings[0]), picture(&drawings[1]));
    let dark = features.iter().filter(|x| **x < 128.0).count() as f64 / features.len() as f64;
    assert!((0.05..0.5).contains(&dark), "{dark} are features");
    let middle = mean(&noise);
    let deviation = (noise.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / noise.len() as f64).sqrt();
    // Three deviations to black and to white; some are beyond.
    assert!((middle - 127.5).abs() < 5.0 && (deviation - 42.5).abs() < 5.0, "{middle} {deviation}");
    // Under a feature there is no noise.
    let under: Vec<f64> = features.iter().zip(&noise).filter(|(f, _)| **f < 5.0).map(|(_, n)| *n).collect();
    let middle = mean(&under);
    let left = (under.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / under.len() as f64).sqrt();
    assert!(under.len() > 1000 && left < 0.2 * deviation, "{left} of {deviation} is left");
}

#[test]
fn figure_6_has_three_ways_over_an_image_and_what_each_meets() {
    let svg = &figure("6")[0];
    assert!(!picture(svg).0.is_empty());
    let paths = values(svg, "path", "", "d");
    assert_eq!(paths.len(), 3, "a path each");
    let profiles = heights(svg);
    let lengths: Vec<f64> = labels(svg, " m").iter().filter_map(|text| text.parse().ok()).collect();
    assert!(profiles.len() == 3 && lengths.len() == 3 && lengths.iter().all(|m| *m > 0.5), "{lengths:?}");
    for (k, profile) in profiles.iter().enumerate() {
        let middle = mean(profile);
        let (above, below) =
            (profile.iter().filter(|x| **x > middle), profile.iter().filter(|x| **x < middle));
        assert!(profile.len() > 200 && above.count() > 50 && below.count() > 50, "profile {k}");
        let next = &profiles[(k + 1) % 3];
        let both = profile.len().min(next.len());
        assert!(correlation(&profile[..both], &next[..both]).abs() < 0.5, "each path crosses something else");
    }
}

#[test]
fn table_7_has_the_bytes_that_the_book_says() {
    let sizes: serde_json::Value = serde_json::from_str(&figure("table 7")[0]).unwrap();
    let bytes = |what: &str| {
        let entries = sizes["entries"].as_array().unwrap();
        let found = entries.iter().find(|entry| entry["what"].as_str().unwrap().starts_with(what));
        found.unwrap_or_else(|| panic!("{what}: {sizes}"))["bytes"].as_u64().unwrap()
    };
    // The second column of each row of the book's tables.
    let reported = |row: &str| {
        let row = BOOK.lines().find(|line| line.starts_with(&format!("| {row} |"))).unwrap();
        row.split('|').map(str::trim).collect::<Vec<_>>()
    };
    for (row, what) in [
        ("one bit, the paper's", "map, one bit"),
        ("one byte", "map, one byte"),
        ("signed pairs, which have directions", "map, signed pairs"),
        ("features as bits, noise as a profile", "features as bits, noise as a profile"),
    ] {
        assert_eq!(reported(row)[2].replace(',', ""), bytes(what).to_string(), "{row}");
    }
    let thousands = |bytes: u64| format!("{:.0}", bytes as f64 / 1000.0);
    assert_eq!(reported("image")[3], thousands(sizes["image"].as_u64().unwrap()));
    assert_eq!(reported("isophotes")[3], thousands(bytes("isophotes")));
    assert_eq!(reported("features and noise")[3], thousands(bytes("features as bits, noise as a profile")));
    // As in the paper, features and noise take least and the isophotes most of what a complex texture is stored as.
    assert!(
        bytes("features as bits, noise as a profile") < bytes("map, one byte")
            && bytes("isophotes") > bytes("map, one byte")
    );
}
