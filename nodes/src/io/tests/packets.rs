use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use super::super::{
    AudioError, AudioReader, AudioWarning, FileFormat, ReadLimits, SampleFormat, probe, probe_with,
};
use super::*;

#[test]
fn flac_gives_the_exact_samples() {
    let (info, samples) = read_all(FLAC, 700).unwrap();
    assert_eq!((info.format, info.rate, info.channels, info.frames), (FileFormat::Flac, 22_050, 1, 5000));
    assert_eq!(info.sample_format, SampleFormat::Int { bits: 16 });
    assert_eq!(info.warnings, []);
    assert!(tone_error(&samples, 1, 0, 22_050.0) < 1.01 / 32_768.0);
    let (info, samples) = read_all(FLAC_24, 700).unwrap();
    assert_eq!((info.rate, info.frames, info.sample_format), (48_000, 5000, SampleFormat::Int { bits: 24 }));
    assert!(tone_error(&samples, 1, 0, 48_000.0) < 1.01 / 8_388_608.0);
}

#[test]
fn encoder_delay_and_padding_are_removed() {
    for (bytes, frames, channels, rate, worst) in [
        (OGG, 5000, 1, 22_050.0, 0.03),
        (OGG_STEREO, 6000, 2, 44_100.0, 0.03),
        (MP3, 5000, 1, 22_050.0, 0.1),
        (MP3_STEREO, 6000, 2, 44_100.0, 0.1),
    ] {
        let (info, samples) = read_all(bytes, 333).unwrap();
        assert_eq!((info.frames, info.channels), (frames, channels));
        assert_eq!(info.sample_format, SampleFormat::Lossy);
        assert_eq!(info.warnings, [], "{:?}", info.format);
        // The ends have pre- and post-echoes; the middle is the tone in phase, within the noise of the codec.
        for channel in 0..channels {
            let error = tone_error(&samples, channels, channel, rate);
            assert!(error < 0.6, "{:?} {error}", info.format);
            let mut middle = samples.clone();
            let clean = |n: usize| {
                let x = std::f64::consts::TAU * 1000.0 * (channel + 1) as f64 / rate * n as f64;
                (10_f64.powf(-0.3) * x.sin()) as f32
            };
            for (n, frame) in middle.chunks_mut(channels).enumerate() {
                if n < 1500 || n > frames as usize - 1500 {
                    frame[channel] = clean(n);
                }
            }
            let middle = tone_error(&middle, channels, channel, rate);
            assert!(middle < worst, "{:?} {middle}", info.format);
        }
    }
}

#[test]
fn all_packets_of_an_mp3_without_a_tag_are_read() {
    let (info, _) = read_all(MP3_UNTAGGED, 100).unwrap();
    // LAME adds 576 frames of delay and pads the last packet; the decoder adds no delay.
    assert_eq!(info.frames % 576, 0);
    assert!((5576..=5000 + 4 * 576).contains(&info.frames), "{}", info.frames);
    assert_eq!(info.warnings, []);
}

#[test]
fn blocks_of_any_size_return_the_same_samples() {
    for bytes in [FLAC, FLAC_24, OGG, OGG_STEREO, MP3, MP3_STEREO, MP3_UNTAGGED] {
        let expected = read_all(bytes, 100_000).unwrap().1;
        for block in [1, 7, 64, 1000] {
            assert!(read_all(bytes, block).unwrap().1 == expected);
        }
    }
}

#[test]
fn a_seek_returns_the_samples_of_a_read_from_the_start() {
    for bytes in [FLAC, FLAC_24, OGG, OGG_STEREO, OGG_LONG, MP3, MP3_STEREO] {
        let expected = read_all(bytes, 4096).unwrap().1;
        let mut reader = open(bytes).unwrap();
        let channels = reader.info().channels;
        let frames = reader.info().frames;
        for frame in [4000, 17, 1024, 1023, 0, frames, 2500, frames - 1, 2500, 2501] {
            reader.seek(frame).unwrap();
            assert_eq!(reader.position(), frame);
            let mut out = vec![0.0; 900 * channels];
            let n = reader.read(&mut out).unwrap();
            assert_eq!(n as u64, (frames - frame).min(900));
            let at = frame as usize * channels;
            assert!(
                out[..n * channels] == expected[at..at + n * channels],
                "{:?} {frame}",
                reader.info().format
            );
        }
        assert!(matches!(reader.seek(frames + 1), Err(AudioError::SeekPastEnd { .. })));
    }
}

/// A long MP3 of repeated packets, so that a seek must skip packets and restore the decoder state.
#[test]
fn a_seek_into_a_long_mp3_restores_the_decoder_state() {
    let bytes: Vec<u8> = MP3_UNTAGGED.repeat(30);
    let expected = read_all(&bytes, 4096).unwrap().1;
    let mut reader = open(&bytes).unwrap();
    assert!(reader.info().frames > 150_000);
    for frame in [149_000_u64, 90_001, 100_000] {
        reader.seek(frame).unwrap();
        let mut out = vec![0.0; 2000];
        assert_eq!(reader.read(&mut out).unwrap(), 2000);
        assert!(out == expected[frame as usize..frame as usize + 2000], "{frame}");
    }
}

#[test]
fn a_truncated_file_is_read_with_a_warning() {
    for bytes in [FLAC, FLAC_24, OGG_LONG, MP3, MP3_STEREO] {
        let expected = read_all(bytes, 1000).unwrap().1;
        let cut = &bytes[..bytes.len() * 3 / 4];
        let (info, samples) = read_all(cut, 1000).unwrap();
        assert!(info.frames > 1000 && samples.len() < expected.len(), "{:?} {}", info.format, info.frames);
        let intact = samples.len() - 2000.min(samples.len());
        assert!(samples[..intact] == expected[..intact], "{:?}", info.format);
        assert!(
            info.warnings
                .iter()
                .any(|w| matches!(w, AudioWarning::LengthDiffers { .. } | AudioWarning::NoEnd)),
            "{:?}",
            info.format
        );
    }
}

#[test]
fn a_corrupt_packet_is_counted_silence_and_later_samples_keep_their_times() {
    let mut bytes = FLAC.to_vec();
    // The second of five frames of 1024 samples: its residual, not its header.
    let sync = |from: usize| from + bytes[from..].windows(2).position(|w| w == [0xFF, 0xF8]).unwrap();
    let second = sync(sync(42) + 2);
    let expected = read_all(FLAC, 1000).unwrap().1;
    for b in &mut bytes[second + 100..second + 130] {
        *b ^= 0x5A;
    }
    let (info, samples) = read_all(&bytes, 1000).unwrap();
    assert_eq!(info.frames, 5000);
    assert_eq!(info.warnings, [AudioWarning::CorruptPackets { packets: 1 }]);
    assert!(samples[1024..2048].iter().all(|&x| x == 0.0));
    assert!(samples[..1024] == expected[..1024]);
    assert!(samples[2048..] == expected[2048..], "later samples keep their times");
}

/// Known limit: pages after a page with a wrong checksum move forward in time, with a warning.
#[test]
fn a_second_ogg_stream_after_the_first_is_reported() {
    let (info, samples) = read_all(&[OGG, OGG_STEREO].concat(), 333).unwrap();
    assert_eq!((info.frames, info.channels, samples.len()), (5000, 1, 5000));
    assert_eq!(info.warnings, [AudioWarning::Chained { frames: 5000, rate: 22_050 }]);
    assert!(info.warnings[0].to_string().contains("5000 frames (0.227 s)"), "{}", info.warnings[0]);
}

#[test]
fn a_file_that_ends_in_its_header_is_an_error() {
    for bytes in [&FLAC[..30], &OGG[..60]] {
        let error = read_all(bytes, 333).unwrap_err().to_string();
        assert!(error.ends_with("it ends within its header") && !error.contains("byte 0"), "{error}");
    }
}

#[test]
fn a_lost_ogg_page_is_reported() {
    let page = |(i, w): (usize, &[u8])| (w == b"OggS").then_some(i);
    let pages: Vec<usize> = OGG_LONG.windows(4).enumerate().filter_map(page).collect();
    let expected = read_all(OGG_LONG, 1000).unwrap().1;
    assert_eq!(expected.len(), 320_000);
    let mut bytes = OGG_LONG.to_vec();
    bytes[pages[pages.len() - 2] + 60] ^= 1;
    let (info, samples) = read_all(&bytes, 1000).unwrap();
    let frames = info.frames;
    assert!(frames > 70_000 && frames < 100_000);
    assert_eq!(info.warnings, [AudioWarning::LengthDiffers { header_frames: 160_000, frames, rate: 44_100 }]);
    assert!(samples[..120_000] == expected[..120_000]);
}

#[test]
fn an_id3_tag_before_the_audio_is_skipped() {
    let mut bytes = b"ID3\x04\0\0\0\0\x01\x00".to_vec();
    bytes.extend([0; 128]);
    for file in [MP3, FLAC] {
        let tagged = [bytes.as_slice(), file].concat();
        assert!(read_all(&tagged, 1000).unwrap().1 == read_all(file, 1000).unwrap().1);
    }
}

#[test]
fn limits_are_errors_that_name_the_limit() {
    let limits = ReadLimits { max_seconds: 0.1, ..ReadLimits::default() };
    for bytes in [FLAC, OGG, MP3] {
        let error = probe_with(Cursor::new(bytes), limits).unwrap_err();
        assert!(matches!(error, AudioError::Limit { what: "seconds", .. }), "{error}");
    }
    let limits = ReadLimits { max_channels: 1, ..ReadLimits::default() };
    let error = AudioReader::open_with(Box::new(Cursor::new(OGG_STEREO)), limits).err().unwrap();
    assert!(matches!(error, AudioError::Limit { what: "channels", .. }), "{error}");
}

#[test]
fn unsupported_formats_are_rejected_by_name() {
    let name = |bytes: &[u8]| probe(Cursor::new(bytes)).unwrap_err().to_string();
    assert!(name(b"").contains("empty"));
    assert!(name(b"hello world").contains("hello"));
    assert!(name(b"FORM\0\0\0\0AIFF").contains("AIFF"));
    assert!(name(b"\0\0\0\x20ftypM4A ").contains("MPEG-4"));
}

/// The recordings of the data set have the lengths of its table (two decimals).
#[test]
fn real_recordings_have_the_lengths_of_their_table() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    let Ok(readme) = fs::read_to_string(root.join("README.md")) else {
        eprintln!("skipped: no shared data");
        return;
    };
    let mut files = Vec::new();
    collect(&root.join("recordings"), &mut files);
    let mut checked = 0;
    for path in files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let mut file = fs::File::open(&path).unwrap();
        let info = probe(&mut file).unwrap_or_else(|e| panic!("{name}: {e}"));
        let Some(row) = readme.lines().find(|l| l.starts_with(&format!("| {name} |"))) else { continue };
        let Some(cell) = row.split('|').find(|cell| cell.contains(" Hz, ") && cell.contains(" ch, ")) else {
            continue;
        };
        let field = |unit: &str| -> f64 {
            let (before, _) = cell.split_once(unit).unwrap();
            before.rsplit([' ', ',']).next().unwrap().parse().unwrap()
        };
        assert_eq!(f64::from(info.rate), field(" Hz, "), "{name}");
        assert_eq!(info.channels as f64, field(" ch, "), "{name}");
        assert!((info.seconds() - field(" s, ")).abs() < 0.005 + 1e-6, "{name}: {} s", info.seconds());
        checked += 1;
    }
    assert!(checked > 100, "{checked}");
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| ["wav", "flac", "ogg"].iter().any(|x| e == *x)) {
            files.push(path);
        }
    }
}
