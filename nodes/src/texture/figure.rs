//! The figures that maps of textures draw of themselves: those of Picard, Tsingos and Faure (VRIPHYS 2008).

use super::holes::solid;
use super::item::{DiscontinuityMap, FeatureMap, Luma, LumaKind, NoiseMap, NoiseProfile};
use super::luma::most;
use super::picture::{percentile, picture};
use super::profile::variance;
use super::sobel::length;
use crate::plot::{Axis, Line, chart};

/// Length of a profile that is drawn, in samples.
const SHOWN: usize = 2000;

/// The image as it is heard.
pub(super) fn luma(luma: &Luma) -> Option<String> {
    let unit = match luma.kind {
        LumaKind::Lstar => "lightness, 0 to 100",
        LumaKind::Rec601 => "luminance, 0 to 255",
    };
    picture(&format!("Surface: {unit}"), &luma.grid, [0.0, most(luma.kind)], &luma.surface)
}

/// The length of the gradient, bright where luminance changes: figure 3.
pub(super) fn discontinuities(map: &DiscontinuityMap) -> Option<String> {
    let g = length(&map.gx, &map.gy);
    let top = percentile(g.samples.iter().copied(), 0.999);
    let title = format!("Discontinuity map: white is a change of {top:.3} per pixel");
    picture(&title, &g, [0.0, top], &map.surface)
}

/// Features dark on white: figure 5.
pub(super) fn features(map: &FeatureMap) -> Option<String> {
    picture("Main features", &map.grid, [1.0, 0.0], &map.surface)
}

/// Noise in grey, three deviations to black and white: figure 5.
pub(super) fn noise(map: &NoiseMap) -> Option<String> {
    let deviation = variance(solid(&map.grid, &map.holes)).sqrt() as f32;
    let ends = [-3.0 * deviation, 3.0 * deviation];
    picture(&format!("Noise: standard deviation {deviation:.3}"), &map.grid, ends, &map.surface)
}

/// The start of a profile.
pub(super) fn profile(profile: &NoiseProfile) -> Option<String> {
    let shown = &profile.samples[..profile.samples.len().min(SHOWN)];
    let most = shown.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    if shown.len() < 2 || most <= 0.0 {
        return None;
    }
    let points = shown.iter().enumerate().map(|(k, x)| [k as f64 * profile.spacing, f64::from(*x)]).collect();
    let axis = |label: &str, range| Axis { label: label.into(), range, log: false };
    let most = f64::from(most);
    let round = profile.samples.len() as f64 * profile.spacing;
    Some(chart(
        &format!("Noise profile: the first of {round:.2} m"),
        &axis("place, m", [0.0, (shown.len() - 1) as f64 * profile.spacing]),
        &axis("height, luminance", [-most, most]),
        &[Line { label: String::new(), points }],
    ))
}
