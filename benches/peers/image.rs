//! Item 9: Contour lines, Sobel magnitude, difference of Gaussians (1.0 and 1.6) and bilateral filter (9 by 9, 2 and 0.1) of smooth noise of 512
//! and 4096 pixels a side, in single precision.
//!
//! foley cuts Gaussians off at four standard deviations, as SciPy and OpenCV do, and its bilateral filter covers a circle of radius 4, as that of
//! OpenCV does. Borders are reflected. OpenCV leaves the gradient eight times as steep.

use super::data::smooth_noise;
use super::measure::{Item, threads};
use foley_nodes::texture::bilateral::{BilateralParams, bilateral};
use foley_nodes::texture::dog::{DogParams, difference};
use foley_nodes::texture::sobel::magnitude;
use foley_nodes::texture::{Field, Saddle, Wrap, contours};

pub fn bench(item: Item) {
    let t = threads();
    for size in [512, 4096] {
        let image = smooth_noise(size);
        let field = Field { width: size, samples: &image.samples, torus: false };
        let curves = || contours(&field, &[0.5], Saddle::Decider);
        item.print(
            &format!("points.{size}"),
            curves().iter().map(|c| c.points.len()).sum::<usize>() as f64,
            "points",
        );
        item.time(&format!("marching-squares.{size}.{t}t"), 1e3, "ms", curves);
        item.time(&format!("sobel.{size}.{t}t"), 1e3, "ms", || magnitude(&image, Wrap::Mirror));
        let widths = DogParams { sigma_e: 1.0, ratio: 1.6, tau: 1.0, ..DogParams::default() };
        item.time(&format!("dog.{size}.{t}t"), 1e3, "ms", || difference(&image, widths, Wrap::Mirror));
        let widths = BilateralParams { sigma_d: 2.0, sigma_r: 0.1 };
        item.time(&format!("bilateral9.{size}.{t}t"), 1e3, "ms", || bilateral(&image, widths, Wrap::Mirror));
    }
}
