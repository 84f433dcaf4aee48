//! Points of damping from CSV or JSON: rejected, or points that an estimator accepts.
#![no_main]

use foley_nodes::material::estimation::point::check_points;
use foley_nodes::material::read_points;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(points) = read_points(bytes) {
        assert!(check_points(&points.points).is_ok());
    }
});
