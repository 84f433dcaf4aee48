use std::io::Cursor;

use super::super::{AudioError, AudioWriter, Dither, WriteFormat, WriteSpec, WrittenInfo};
use super::read_all;
use crate::core::random::Random;

const FORMATS: [WriteFormat; 3] = [WriteFormat::Pcm16, WriteFormat::Pcm24, WriteFormat::Float32];

fn write_in_blocks(spec: WriteSpec, samples: &[f32], block: usize, limit: u64) -> (Vec<u8>, WrittenInfo) {
    let mut file = Cursor::new(Vec::new());
    let mut writer = AudioWriter::with_riff_limit(&mut file, spec, limit).unwrap();
    for block in samples.chunks(block * spec.channels) {
        writer.write(block).unwrap();
    }
    let info = writer.finish().unwrap();
    (file.into_inner(), info)
}

fn ramp(n: usize) -> Vec<f32> {
    (0..n).map(|i| ((i * 37) % 1999) as f32 / 1000.0 - 1.0).collect()
}

#[test]
fn written_samples_are_read_back_within_the_dither() {
    for format in FORMATS {
        for channels in [1, 2, 3, 5, 8, 12] {
            let samples = ramp(channels * 501);
            let (file, written) =
                write_in_blocks(WriteSpec::new(48_000, channels, format), &samples, 100, u64::MAX);
            let (info, read) = read_all(&file, 77).unwrap();
            assert_eq!((info.rate, info.channels, info.frames, written.frames), (48_000, channels, 501, 501));
            assert_eq!(info.warnings, []);
            let step = match format {
                WriteFormat::Pcm16 => 1.5 / 32_768.0,
                WriteFormat::Pcm24 => 1.5 / 8_388_608.0 + 1e-7,
                WriteFormat::Float32 => 0.0,
            };
            let worst = read.iter().zip(&samples).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= step, "{format:?} {channels} {worst}");
        }
    }
}

#[test]
fn blocks_of_any_size_write_the_same_file() {
    let samples = ramp(2 * 3000);
    for format in FORMATS {
        let spec = WriteSpec::new(44_100, 2, format);
        let expected = write_in_blocks(spec, &samples, 3000, u64::MAX);
        for block in [1, 7, 64, 1000] {
            assert!(write_in_blocks(spec, &samples, block, u64::MAX) == expected, "{format:?} {block}");
        }
    }
}

#[test]
fn hound_reads_written_files() {
    for format in FORMATS {
        for channels in [1, 2, 6] {
            let samples = ramp(channels * 101);
            let spec = WriteSpec { dither: Dither::None, ..WriteSpec::new(96_000, channels, format) };
            let (file, _) = write_in_blocks(spec, &samples, 10, u64::MAX);
            let ours = read_all(&file, 50).unwrap().1;
            let mut reader = hound::WavReader::new(Cursor::new(&file)).unwrap();
            assert_eq!(usize::from(reader.spec().channels), channels);
            let theirs: Vec<f32> = match format {
                WriteFormat::Float32 => reader.samples::<f32>().map(Result::unwrap).collect(),
                _ => {
                    let scale = 2_f32.powi(i32::from(reader.spec().bits_per_sample) - 1);
                    reader.samples::<i32>().map(|s| s.unwrap() as f32 / scale).collect()
                }
            };
            assert_eq!(ours, theirs);
        }
    }
}

#[test]
fn a_file_above_the_limit_becomes_rf64() {
    let samples = ramp(3001);
    for format in FORMATS {
        let spec = WriteSpec::new(44_100, 1, format);
        let (small, _) = write_in_blocks(spec, &samples, 100, u64::MAX);
        let (large, _) = write_in_blocks(spec, &samples, 100, 4000);
        assert_eq!((&small[..4], &large[..4]), (b"RIFF".as_slice(), b"RF64".as_slice()));
        assert_eq!(small.len(), large.len());
        assert_eq!((&small[12..16], &large[12..16]), (b"JUNK".as_slice(), b"ds64".as_slice()));
        let (info, read) = read_all(&large, 1000).unwrap();
        assert_eq!((info.frames, info.warnings), (3001, vec![]));
        assert!(read == read_all(&small, 1000).unwrap().1);
    }
}

#[test]
fn samples_beyond_full_scale_are_clamped_and_counted() {
    let samples = [0.0, 1.0, -1.0, 1.5, -3.0, 0.999];
    let spec = WriteSpec { dither: Dither::None, ..WriteSpec::new(8000, 1, WriteFormat::Pcm16) };
    let (file, info) = write_in_blocks(spec, &samples, 4, u64::MAX);
    assert_eq!((info.clipped, info.peak), (2, 3.0));
    let mean = samples.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() / 6.0;
    assert!((info.rms - mean.sqrt()).abs() < 1e-12);
    let full = 32_767.0 / 32_768.0;
    assert_eq!(read_all(&file, 9).unwrap().1[..5], [0.0, full, -1.0, full, -1.0]);
    let (file, info) =
        write_in_blocks(WriteSpec { format: WriteFormat::Float32, ..spec }, &samples, 4, u64::MAX);
    assert_eq!((read_all(&file, 9).unwrap().1, info.clipped), (samples.to_vec(), 2));
}

/// Triangular dither makes the mean error 0 and its variance a quarter of a squared step at any level.
#[test]
fn dither_makes_the_error_independent_of_the_signal() {
    for level in [0.0, 0.25, 0.5, 0.8] {
        let n = 100_000;
        let samples = vec![level / 32_768.0; n];
        let spec = WriteSpec::new(48_000, 1, WriteFormat::Pcm16);
        let (file, _) = write_in_blocks(spec, &samples, n, u64::MAX);
        let errors: Vec<f64> = read_all(&file, n)
            .unwrap()
            .1
            .iter()
            .map(|&x| f64::from(x) * 32_768.0 - f64::from(level))
            .collect();
        let mean = errors.iter().sum::<f64>() / n as f64;
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / n as f64;
        assert!(mean.abs() < 5.0 * 0.5 / (n as f64).sqrt(), "{level} {mean}");
        assert!((variance - 0.25).abs() < 0.01, "{level} {variance}");
    }
}

#[test]
fn channels_and_seeds_have_different_dither() {
    let silence = [0.0; 2000];
    let file = |seed| {
        let dither = Dither::Triangular(Random::new(seed, "out"));
        let spec = WriteSpec { dither, ..WriteSpec::new(48_000, 2, WriteFormat::Pcm16) };
        read_all(&write_in_blocks(spec, &silence, 100, u64::MAX).0, 1000).unwrap().1
    };
    assert_ne!(file(1), file(2));
    let one = file(1);
    assert!(one.chunks(2).any(|f| f[0] != f[1]));
}

#[test]
fn an_unfinished_file_is_read_to_its_end() {
    let mut file = Cursor::new(Vec::new());
    let mut writer = AudioWriter::new(&mut file, WriteSpec::new(8000, 1, WriteFormat::Float32)).unwrap();
    writer.write(&[0.5; 10]).unwrap();
    drop(writer);
    assert_eq!(read_all(file.get_ref(), 4).unwrap().1, [0.5; 10]);
}

#[test]
fn invalid_specs_and_samples_are_errors() {
    let new = |rate, channels| {
        AudioWriter::new(Cursor::new(Vec::new()), WriteSpec::new(rate, channels, WriteFormat::Pcm24))
    };
    assert!(matches!(new(48_000, 0), Err(AudioError::WriteSpec { what: "channels", .. })));
    assert!(matches!(new(0, 1), Err(AudioError::WriteSpec { what: "rate", .. })));
    assert!(matches!(new(48_000, 30_000), Err(AudioError::WriteSpec { .. })));
    let mut writer = new(48_000, 2).unwrap();
    assert!(matches!(writer.write(&[0.0; 3]), Err(AudioError::PartialFrame { len: 3, channels: 2 })));
    writer.write(&[0.0; 4]).unwrap();
    let error = writer.write(&[0.0, 0.0, 0.0, f32::INFINITY]).unwrap_err();
    assert!(matches!(error, AudioError::NotFinite { frame: 3, channel: 1, .. }), "{error}");
}

/// A disk that refuses all bytes beyond its room.
struct FullDisk {
    file: std::io::Cursor<Vec<u8>>,
    room: usize,
}

impl std::io::Write for FullDisk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let left = self.room.saturating_sub(self.file.position() as usize).min(bytes.len());
        if left == 0 && !bytes.is_empty() {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        self.file.write(&bytes[..left])
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl std::io::Seek for FullDisk {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

#[test]
fn a_file_that_a_full_disk_cuts_has_the_whole_frames_that_are_there() {
    use crate::io::{AudioReader, AudioWriter, WriteFormat, WriteSpec};
    for format in [WriteFormat::Pcm16, WriteFormat::Pcm24, WriteFormat::Float32] {
        for channels in [1, 2, 3] {
            for room in 1000..1013 {
                let mut disk = FullDisk { file: std::io::Cursor::default(), room };
                let mut writer = AudioWriter::new(&mut disk, WriteSpec::new(8000, channels, format)).unwrap();
                let block = vec![0.5; 60 * channels];
                while writer.write(&block).is_ok() {}
                let written = writer.finish_cut().unwrap();
                let bytes = disk.file.into_inner();
                let reader = AudioReader::open(Box::new(std::io::Cursor::new(bytes))).unwrap();
                let info = reader.info();
                assert_eq!(info.frames, written.frames, "{format:?}, {channels} channels, {room} bytes");
                assert!(info.warnings.is_empty() && written.frames > 60, "{info:?}");
            }
        }
    }
}
