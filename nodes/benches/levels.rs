//! Time to match all levels of detail before a run: LevelMatcher on one image, PairMatcher on two.
//!
//! Run with `cargo bench -p foley-nodes -- levels`. The aim is 1 s.

use foley_nodes::core::item::AnyValue;
use foley_nodes::core::params::Params;
use foley_nodes::core::standalone::{Feed, Standalone};
use foley_nodes::modal::Modes;
use foley_nodes::scrape::level::StrokeParams;
use foley_nodes::scrape::level::level_matcher::{LevelMatcher, LevelMatcherParams, LevelMatcherPorts};
use foley_nodes::scrape::level::pair_matcher::{PairMatcher, PairMatcherParams, PairMatcherPorts};
use foley_nodes::texture::bilateral::{BilateralParams, bilateral};
use foley_nodes::texture::decode::decode;
use foley_nodes::texture::dog::{DogParams, features};
use foley_nodes::texture::luma::luminance;
use foley_nodes::texture::profile::{PROFILE, profile};
use foley_nodes::texture::sobel::gradient;
use foley_nodes::texture::split::noise;
use foley_nodes::texture::{
    Detail, DiscontinuityMap, Drawing, FeatureMap, Isophotes, Levels, Luma, LumaKind, NoiseMap, NoiseProfile,
    Surface, isophotes,
};
use std::error::Error;
use std::time::Instant;

/// The data computed from an image before its levels are matched.
struct Analysis {
    luma: Luma,
    map: DiscontinuityMap,
    features: FeatureMap,
    rest: NoiseMap,
    noise: NoiseProfile,
    curves: Isophotes,
    lines: Isophotes,
}

fn analyse(name: &str, density: f64) -> Result<Analysis, Box<dyn Error>> {
    let path = format!("{}/../graphs/assets/images/{name}.png", env!("CARGO_MANIFEST_DIR"));
    let (grid, _) = luminance(&decode(&std::fs::read(path)?)?, LumaKind::Lstar, false)?;
    let surface = Surface { density: [density; 2], ..Surface::default() };
    let smooth = bilateral(&grid, BilateralParams { sigma_d: 3.0, sigma_r: 4.25 }, surface.wrap);
    let lines = features(&smooth, DogParams::default(), surface.wrap);
    let rest = NoiseMap { grid: noise(&grid, &smooth, Some(&lines), &[]), holes: Vec::new(), surface };
    let [gx, gy] = gradient(&grid, surface.wrap);
    let luma = Luma { grid, holes: Vec::new(), kind: LumaKind::Lstar, surface };
    // The spacing of one sample at 2 m/s.
    let times = (44_100.0 / 2.0 / density).ceil() as u32;
    Ok(Analysis {
        map: DiscontinuityMap { gx, gy, surface },
        features: FeatureMap { grid: lines, surface },
        noise: NoiseProfile { detail: Some(Detail { factor: times, seed: 1 }), ..profile(&rest, PROFILE) },
        rest,
        curves: isophotes(&luma, &Drawing::default())?,
        lines: isophotes(&luma, &Drawing { levels: Levels::Quantiles(2), ..Drawing::default() })?,
        luma,
    })
}

/// Returns the best of three times, in ms.
fn time(standalone: &Standalone) -> Result<f64, Box<dyn Error>> {
    let mut best = f64::MAX;
    for _ in 0..3 {
        let start = Instant::now();
        standalone.run()?;
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(best)
}

pub fn bench() -> Result<(), Box<dyn Error>> {
    let modes = Modes::new("bench", vec![271.0, 410.0, 663.0, 1190.0], vec![9.0; 4], vec![1.0; 4])?;
    println!("ms to match all levels, on all cores                       ms     aim");
    for name in ["sk_brick", "sk_gravel", "tiles"] {
        let image = analyse(name, 512.0)?;
        for (what, by_speed) in [("17 speeds", true), ("one speed", false)] {
            let p = LevelMatcherParams::read(&|_| None).map_err(|e| format!("{e:?}"))?;
            let p = LevelMatcherParams {
                speed: 1.2,
                stroke: StrokeParams { force: 11.0, by_speed, ..p.stroke },
                ..p
            };
            type P = LevelMatcherPorts;
            let standalone = Standalone::func::<LevelMatcher>(p)
                .feed(P::map.index(), Feed::value(AnyValue::new(image.map.clone())))
                .feed(P::isophotes.index(), Feed::value(AnyValue::new(image.curves.clone())))
                .feed(P::features.index(), Feed::value(AnyValue::new(image.features.clone())))
                .feed(P::rest.index(), Feed::value(AnyValue::new(image.rest.clone())))
                .feed(P::noise.index(), Feed::value(AnyValue::new(image.noise.clone())))
                .feed(P::spectrum.index(), Feed::value(AnyValue::new(image.noise.clone())))
                .feed(P::modes.index(), Feed::value(AnyValue::new(modes.clone())));
            println!("  {:<50} {:8.0}    1000", format!("{name}, {what}"), time(&standalone)?);
        }
    }
    let (a, b) = (analyse("sk_gravel", 2048.0)?, analyse("sk_brick", 4096.0)?);
    let p = PairMatcherParams::read(&|_| None).map_err(|e| format!("{e:?}"))?;
    let p =
        PairMatcherParams { speed: 0.6, other: 0.4, stroke: StrokeParams { force: 3.0, ..p.stroke }, ..p };
    type P = PairMatcherPorts;
    let standalone = Standalone::func::<PairMatcher>(p)
        .feed(P::a.index(), Feed::value(AnyValue::new(a.luma)))
        .feed(P::b.index(), Feed::value(AnyValue::new(b.luma)))
        .feed(P::lines_a.index(), Feed::value(AnyValue::new(a.lines)))
        .feed(P::lines_b.index(), Feed::value(AnyValue::new(b.lines)))
        .feed(P::rest_a.index(), Feed::value(AnyValue::new(a.rest)))
        .feed(P::rest_b.index(), Feed::value(AnyValue::new(b.rest)))
        .feed(P::noise_a.index(), Feed::value(AnyValue::new(a.noise.clone())))
        .feed(P::noise_b.index(), Feed::value(AnyValue::new(b.noise.clone())))
        .feed(P::spectrum_a.index(), Feed::value(AnyValue::new(a.noise)))
        .feed(P::spectrum_b.index(), Feed::value(AnyValue::new(b.noise)))
        .feed(P::modes.index(), Feed::value(AnyValue::new(modes)));
    println!("  {:<50} {:8.0}    1000", "gravel and bricks on each other, 17 speeds", time(&standalone)?);
    Ok(())
}
