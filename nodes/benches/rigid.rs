//! Time to read contact logs, and time per frame of a contact to classify it.
//!
//! Run with `cargo bench -p foley-nodes -- rigid`. One core. The reference is the split of the
//! text into fields without parsing numbers.

use crate::common::best;
use foley_nodes::core::time::TICKS_PER_SECOND;
use foley_nodes::rigid::{Classifier, LogOptions, Manifold, Rules, read_contacts};
use std::fmt::Write;

/// Returns a log of the contact points of a sliding box and of five rolling balls, at 240 frames per second.
fn log(rows: usize) -> String {
    let mut text = String::from("time,a,b,px,py,pz,nx,ny,nz,force,vx,vy,vz,approach\n");
    for row in 0..rows {
        let (frame, point) = (row / 9, row % 9);
        let t = frame as f64 / 240.0;
        let (body, x, slip) = if point < 4 { (1, 0.3 * t, 0.3) } else { (point - 2, 0.5 * t, 0.0) };
        let y = 0.1 * point as f64 + 0.001 * (frame % 7) as f64;
        let force = 9.81 + 0.1 * (frame % 11) as f64;
        let _ = writeln!(
            text,
            "{t:.6},0,{body},{x:.6},{y:.6},0.000123,0,0,1,{force:.5},{slip},0,0.000345,0.001234"
        );
    }
    text
}

pub fn bench() {
    let text = log(100_000);
    let size = text.len() as f64 / 1e6;
    let split = best(7, || {
        let mut csv = csv::ReaderBuilder::new().from_reader(text.as_bytes());
        let mut record = csv::ByteRecord::new();
        let mut fields = 0;
        while csv.read_byte_record(&mut record).is_ok_and(|more| more) {
            fields += record.len();
        }
        fields
    });
    println!("100000 rows, {size:.1} MB; fields alone: {:.0} MB/s", 1e3 * size / split);
    for (name, manifold) in [("centroids", Manifold::Centroid), ("points", Manifold::Points)] {
        let options = LogOptions { manifold, ..LogOptions::default() };
        let time = best(7, || read_contacts(text.as_bytes(), None, &options).map(|track| track.frames.len()));
        println!("{name}: {:.0} MB/s, {:.0} ms", 1e3 * size / time, time);
    }
    let Ok(track) = read_contacts(text.as_bytes(), None, &LogOptions::default()) else { return };
    let time = best(7, || {
        let mut classifier = Classifier::new(Rules::default(), 64);
        let states = track.frames.iter().filter(|(tick, frame)| classifier.take(*tick, frame).is_some());
        states.count()
    });
    let length = track.frames.last().map_or(0, |(tick, _)| *tick) as f64 / TICKS_PER_SECOND as f64;
    let each = time / track.frames.len() as f64;
    println!("classified: {:.0} ns per frame of a contact; {length:.0} s in {:.1} ms", each * 1e6, time);
}
