//! Any bytes as an audio file: no more frames are read than the header states, also after seeking.
#![no_main]

use foley_nodes::io::{AudioReader, ReadLimits};
use libfuzzer_sys::fuzz_target;
use std::io::Cursor;

fuzz_target!(|data: &[u8]| {
    let source = Box::new(Cursor::new(data.to_vec()));
    let Ok(mut reader) = AudioReader::open_with(source, ReadLimits::default()) else { return };
    let channels = reader.info().channels;
    let mut block = vec![0.0; channels.clamp(1, 256) * 1000];
    let mut total = 0_u64;
    // A small file can stand for very long silence.
    while total < 1 << 20 {
        match reader.read(&mut block) {
            Ok(0) | Err(_) => break,
            Ok(frames) => total += frames as u64,
        }
    }
    assert!(total <= reader.info().frames);
    let _ = reader.seek(total / 2).and_then(|()| reader.read(&mut block));
});
