//! The figures of Picard, Tsingos and Faure (2008), drawn by the commands in the book, have the content of the paper's
//! figures.

use crate::common::figure::{commands, graph, heights, labels, mean, numbers, panels, run, values};
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

/// Correlation of a map with the magnitude of central differences of its image, without the border.
fn edges([image, map]: [&str; 2]) -> f64 {
    let ((image, width), (map, same)) = (picture(image), picture(map));
    assert_eq!((width, image.len()), (same, map.len()));
    let inside = (0..image.len())
        .filter(|k| *k > width && *k < image.len() - width && k % width > 0 && k % width < width - 1);
    let change = |k: usize| {
        let [x, y] = [image[k + 1] - image[k - 1], image[k + width] - image[k - width]];
        x.hypot(y)
    };
    let (changes, bright): (Vec<f64>, Vec<f64>) = inside.map(|k| (change(k), map[k])).unzip();
    correlation(&changes, &bright)
}

#[test]
fn figure_1_has_impacts_and_continuous_contacts_that_excite_modes() {
    let svg = graph(BOOK, "1");
    for node in ["ContactLog", "ContactClassifier", "ImpactForce", "ContactPath", "TwoTextures", "ModalBank"]
    {
        assert!(svg.contains(node), "{node}");
    }
}

#[test]
fn figure_8_has_the_image_the_contacts_and_the_modes_of_an_audio_shader() {
    let svg = graph(BOOK, "8");
    for node in [
        "ContactPath",
        "ImageLuma",
        "HistogramClass",
        "LodSelect",
        "MapExcitation",
        "IsophoteExcitation",
        "NoiseExcitation",
        "ModalFromRecording",
        "ModalBank",
    ] {
        assert!(svg.contains(node), "{node}");
    }
}

#[test]
fn figure_9_has_peak_and_rms_of_the_force_in_each_frame() {
    let svg = &figure("9")[0];
    assert!(svg.contains("time, s"));
    let lines = heights(svg);
    assert_eq!(lines.len(), 2, "peak and RMS");
    // A log of four seconds at 60 frames per second, and what ends after it.
    assert!(lines[0].len() >= 240 && lines[0].len() == lines[1].len(), "{} frames", lines[0].len());
    assert!(lines[0].iter().zip(&lines[1]).all(|(peak, rms)| peak >= rms));
    let [low, high] = [f64::min, f64::max].map(|end| lines[0].iter().copied().reduce(end).unwrap());
    // The fall is the strongest, and most of the time the force is small beside it.
    let strongest = lines[0].iter().position(|x| *x == high).unwrap();
    let strong = lines[0].iter().filter(|x| **x > low + 0.5 * (high - low)).count();
    assert!(high - low > 200.0 && strongest < 120 && (1..20).contains(&strong), "{strongest} {strong}");
}

#[test]
fn figure_2_has_a_broad_histogram_of_a_complex_texture_and_a_narrow_one_of_a_simple_one() {
    let drawings = figure("2");
    let bars: Vec<Vec<f64>> = drawings.iter().map(|svg| numbers(svg, "rect", "#2166ac", " height")).collect();
    assert!(drawings[0].contains("(complex; simple below 0.5)") && drawings[1].contains("(simple; simple"));
    for (drawing, middle) in drawings.iter().zip([80.0..200.0, 180.0..256.0]) {
        let panels = panels(drawing);
        assert!(panels.len() == 2 && panels[1].contains("#2166ac"), "image and histogram");
        let (image, _) = picture(panels[0]);
        assert!(middle.contains(&mean(&image)), "{}", mean(&image));
    }
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
    let found = edges([&drawings[0], &drawings[1]]);
    assert!(found > 0.9, "{found}");
}

#[test]
fn figure_4_has_curves_of_eight_levels_that_are_mostly_closed() {
    let drawing = &figure("4")[0];
    let panels = panels(drawing);
    let [image, svg, map] = panels[..] else { panic!("{} panels", panels.len()) };
    let found = edges([image, map]);
    assert!(found > 0.9, "{found}");
    for label in ["(a) image", "(b) isophotes", "(c) discontinuity map by the Sobel filter"] {
        assert!(drawing.contains(label), "{label}");
    }
    let levels = numbers(svg, "path", "data-level", "data-level");
    assert!(levels.len() == 8 && levels.is_sorted_by(|a, b| a < b), "{levels:?}");
    for (level, path) in levels.iter().zip(values(svg, "path", "data-level", " d")) {
        let (curves, closed) = (path.matches('M').count(), path.matches('Z').count());
        assert!(curves > 100 && closed > curves / 2, "{level}: {closed} of {curves} are closed");
    }
}

#[test]
fn figure_5_has_few_dark_features_and_noise_that_leaves_them_out() {
    let drawing = &figure("5")[0];
    let panels = panels(drawing);
    let [image, features, noise] = panels[..] else { panic!("{} panels", panels.len()) };
    let [(image, _), (features, _), (noise, _)] = [image, features, noise].map(picture);
    assert!(image.len() == features.len() && image.len() == noise.len());
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
fn figure_6_has_three_paths_over_an_image_and_their_profiles() {
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
