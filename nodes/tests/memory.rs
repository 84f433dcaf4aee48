//! Peak memory of the nodes that read images, and of unit selection.
//!
//! The counting allocator counts all threads, so these tests are a separate binary and run one after the other.
#![allow(unsafe_code)]

use foley_nodes::core::item::{AnyValue, Data};
use foley_nodes::core::node::Func;
use foley_nodes::core::params::{Datum, Params};
use foley_nodes::core::random::Rng;
use foley_nodes::core::standalone::{Feed, Standalone, StandaloneRun};
use foley_nodes::texture::class::histogram_class::{HistogramClass, HistogramClassPorts};
use foley_nodes::texture::filter::bilateral::{Bilateral, BilateralPorts};
use foley_nodes::texture::filter::dog_features::{DogFeatures, DogFeaturesPorts};
use foley_nodes::texture::filter::sobel_map::{SobelMap, SobelMapPorts};
use foley_nodes::texture::image::image_luma::ImageLuma;
use foley_nodes::texture::isophote::isophotes::{IsophotesNode, IsophotesPorts};
use foley_nodes::texture::map_code::map_coder::{MapCoder, MapCoderPorts};
use foley_nodes::texture::noise::feature_noise_split::{FeatureNoiseSplit, FeatureNoiseSplitPorts};
use foley_nodes::texture::noise::noise_profile::{NoiseProfileNode, NoiseProfilePorts};
use foley_nodes::texture::{FeatureMap, Grid, Kernel, Luma, NoiseMap, Wrap, smooth};
use foley_nodes::unit::{SelectorParams, Units, selector};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

static CURRENT: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
/// Lock held by the test that measures.
static MEASURING: Mutex<()> = Mutex::new(());

struct Counting;

// SAFETY: every call goes to the system's allocator unchanged; the counters are atomic.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(CURRENT.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: the caller upholds the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        CURRENT.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller upholds the contract of `dealloc`.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the peak memory of some work in bytes, above the memory before it.
fn peak<T>(work: impl FnOnce() -> T) -> (usize, T) {
    let before = CURRENT.load(Relaxed);
    PEAK.store(before, Relaxed);
    let result = work();
    (PEAK.load(Relaxed) - before, result)
}

const SIDE: usize = 1024;

fn node<F: Func>() -> Standalone {
    Standalone::func::<F>(F::Params::read(&|_| None).unwrap())
}

/// Returns the result of a run and asserts that it takes at most six images of 32 bits a pixel, `held` of which are its inputs.
fn measured<T: Data + Clone>(name: &str, standalone: &Standalone, held: usize) -> T {
    let (bytes, run): (usize, StandaloneRun) = peak(|| standalone.run().unwrap());
    let images = bytes as f64 / (4 * SIDE * SIDE) as f64 + held as f64;
    println!("{name}: {images:.2} images");
    assert!(images <= 6.0, "{name} takes {images} images");
    run.value(0).unwrap().get::<T>().unwrap().clone()
}

#[test]
fn units_are_chosen_without_a_table_of_all_distances() {
    let _guard = MEASURING.lock();
    let (units, targets, dims, look) = (20_000, 1000, 3, 5);
    let mut rng = Rng::new(5);
    let mut walk = |n: usize| {
        let mut at = [0.0; 3];
        let mut step = || {
            at = at.map(|x| 0.98 * x + rng.between(-0.3, 0.3));
            at.map(|x| x as f32)
        };
        (0..n).flat_map(|_| step()).collect::<Vec<f32>>()
    };
    let (features, target) = (walk(units), walk(targets));
    let all = Units::new(&features, dims, vec![(0, units)]);
    let p = SelectorParams { look, d_max: 2.0, cool_off: 20, loop_guard: 0, causal: false, effort: None };
    let (built, mut selector) = peak(|| selector(&all, p).unwrap());
    let windows = (0..targets - look).map(|i| &target[dims * i..][..dims * (look + 1)]);
    let (chosen, picks) = peak(|| windows.map(|window| selector.choose(window).unwrap().d1).sum::<f64>());
    println!(
        "{built} bytes to build the index, {chosen} to choose; mean distance {}",
        picks / targets as f64
    );
    // A table of all distances in single precision would be 80 MB, one row 80 kB.
    assert!(built < 500 * units && chosen < 4 * units, "{built} {chosen}");
}

#[test]
fn nodes_that_read_images_take_at_most_six_of_them() {
    let _guard = MEASURING.lock();
    // Noise with grains of about fifteen pixels, in colour.
    let mut rng = Rng::new(3);
    let grain = Grid::from_fn(SIDE, SIDE, |_, _| rng.between(-1.0, 1.0) as f32);
    let grain = smooth(&grain, &Kernel::gaussian(3.5, 4.0), Wrap::Repeat);
    let tones: Vec<u8> = grain.samples.iter().flat_map(|x| [128.0 + 900.0 * x; 3].map(|x| x as u8)).collect();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, SIDE as u32, SIDE as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&tones).unwrap();
    let path = |name: &str| (name == "path").then(|| Datum::Text("stones.png".into()));
    let mut image = Standalone::func::<ImageLuma>(<ImageLuma as Func>::Params::read(&path).unwrap());
    image.files.insert("stones.png", file);
    let luma: Luma = measured("ImageLuma", &image, 0);
    drop(image);
    let histogram = node::<HistogramClass>().value(HistogramClassPorts::luma, luma.clone());
    measured::<foley_nodes::texture::histogram::TextureClass>("HistogramClass", &histogram, 1);
    let sobel = node::<SobelMap>().value(SobelMapPorts::luma, luma.clone());
    let map = measured::<foley_nodes::texture::DiscontinuityMap>("SobelMap", &sobel, 1);
    let coder = node::<MapCoder>().feed(MapCoderPorts::map.index(), Feed::value(AnyValue::new(map)));
    measured::<foley_nodes::texture::code::CodedMap>("MapCoder", &coder, 2);
    let bilateral = node::<Bilateral>().value(BilateralPorts::luma, luma.clone());
    let soft: Luma = measured("Bilateral", &bilateral, 1);
    let dog = node::<DogFeatures>().value(DogFeaturesPorts::luma, soft.clone());
    let features: FeatureMap = measured("DogFeatures", &dog, 1);
    let split = node::<FeatureNoiseSplit>()
        .value(FeatureNoiseSplitPorts::luma, luma.clone())
        .value(FeatureNoiseSplitPorts::smooth, soft)
        .value(FeatureNoiseSplitPorts::features, features);
    let noise: NoiseMap = measured("FeatureNoiseSplit", &split, 3);
    let profile = node::<NoiseProfileNode>().value(NoiseProfilePorts::noise, noise);
    measured::<foley_nodes::texture::NoiseProfile>("NoiseProfile", &profile, 1);
    let isophotes = node::<IsophotesNode>().value(IsophotesPorts::luma, luma);
    measured::<foley_nodes::texture::Isophotes>("Isophotes", &isophotes, 1);
}
