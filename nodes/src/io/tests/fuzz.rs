use std::io::Cursor;

use super::super::{AudioReader, AudioWriter, ReadLimits, WriteFormat, WriteSpec};
use super::*;
use crate::core::random::Random;

fn written(format: WriteFormat, channels: usize, riff_limit: u64) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let spec = WriteSpec::new(8000, channels, format);
    let mut writer = AudioWriter::with_riff_limit(&mut file, spec, riff_limit).unwrap();
    writer.write(&vec![0.25; channels * 100]).unwrap();
    writer.finish().unwrap();
    file.into_inner()
}

/// Changes bytes, truncates, duplicates or removes a segment; often near the start, where headers are.
fn mutate(file: &[u8], random: &Random, case: u64) -> Vec<u8> {
    let mut bytes = file.to_vec();
    let changes = 1 + random.words(0, case, 0)[0] % 6;
    for change in 0..changes {
        let w = random.words(1, case, change);
        if bytes.is_empty() {
            break;
        }
        let span = if w[3] & 1 == 0 { bytes.len().min(128) } else { bytes.len() };
        let at = w[0] as usize % span;
        match w[1] % 8 {
            0 => bytes.truncate(at),
            1 => {
                let end = (at + w[2] as usize % 64).min(bytes.len());
                bytes.drain(at..end);
            }
            2 => {
                let end = (at + w[2] as usize % 64).min(bytes.len());
                let segment = bytes[at..end].to_vec();
                bytes.splice(at..at, segment);
            }
            3 => bytes[at] = [0, 1, 0x7F, 0x80, 0xFF][w[2] as usize % 5],
            _ => bytes[at] ^= 1 << (w[2] % 8),
        }
    }
    bytes
}

/// Recomputes the checksums of the pages of an Ogg file, so that mutations reach the decoder.
fn repair_ogg(bytes: &mut [u8]) {
    let mut at = 0;
    while bytes.len() >= at + 27 && bytes[at..].starts_with(b"OggS") {
        let segments = usize::from(bytes[at + 26]);
        let Some(table) = bytes.get(at + 27..at + 27 + segments) else { return };
        let end = at + 27 + segments + table.iter().map(|&n| usize::from(n)).sum::<usize>();
        let Some(page) = bytes.get_mut(at..end) else { return };
        page[22..26].fill(0);
        let crc = page.iter().fold(0_u32, |crc, &b| {
            (0..8).fold(crc ^ (u32::from(b) << 24), |c, _| {
                (c << 1) ^ if c >> 31 == 1 { 0x04C1_1DB7 } else { 0 }
            })
        });
        page[22..26].copy_from_slice(&crc.to_le_bytes());
        at = end;
    }
}

#[test]
fn mutated_files_neither_panic_nor_exceed_the_limits() {
    let wav16 = written(WriteFormat::Pcm16, 2, u64::MAX);
    let wav24 = written(WriteFormat::Pcm24, 3, 100);
    let wav32 = written(WriteFormat::Float32, 1, u64::MAX);
    let files: [(&[u8], u64); 9] = [
        (&wav16, 2000),
        (&wav24, 2000),
        (&wav32, 2000),
        (FLAC, 500),
        (FLAC_24, 500),
        (OGG, 400),
        (OGG_STEREO, 300),
        (MP3, 500),
        (MP3_STEREO, 300),
    ];
    let limits = ReadLimits { max_seconds: 3.0, max_channels: 8, max_rate: 200_000 };
    let random = Random::new(11, "fuzz");
    let mut opened = 0;
    let mut out = vec![0.0; 840 * 40];
    for (kind, (file, cases)) in files.into_iter().enumerate() {
        for case in 0..cases {
            let mut bytes = mutate(file, &random, case + 1_000_000 * kind as u64);
            if case % 4 != 0 {
                repair_ogg(&mut bytes);
            }
            let Ok(mut reader) = AudioReader::open_with(Box::new(Cursor::new(&bytes)), limits) else {
                continue;
            };
            opened += 1;
            let info = reader.info().clone();
            assert!(info.channels <= 8 && info.rate <= 200_000 && info.seconds() <= 3.0);
            let mut total = 0;
            let out = &mut out[..840 * 40 / info.channels * info.channels];
            while let Ok(n @ 1..) = reader.read(out) {
                total += n as u64;
            }
            assert!(total <= info.frames);
            if info.frames > 0 && reader.seek(info.frames / 2).is_ok() {
                let _ = reader.read(&mut out[..info.channels]);
            }
        }
    }
    assert!(opened > 1000, "{opened}");
}
