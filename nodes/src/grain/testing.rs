//! Recordings for tests.

use crate::io::AudioReader;

/// The mean of the channels of a recording of the examples, and its rate.
pub fn recording(name: &str) -> (Vec<f32>, u32) {
    let path = format!("{}/../graphs/assets/recordings/{name}", env!("CARGO_MANIFEST_DIR"));
    let mut reader = AudioReader::open(Box::new(std::fs::File::open(path).unwrap())).unwrap();
    let rate = reader.info().rate;
    (reader.read_mono().unwrap(), rate)
}
