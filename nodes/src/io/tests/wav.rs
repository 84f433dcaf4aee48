use std::io::{Cursor, Read, Seek, SeekFrom};

use super::super::{AudioError, AudioReader, AudioWarning, ReadLimits, SampleFormat};
use super::{open, read_all};
use crate::core::random::Random;

/// A chunk with its pad byte.
fn chunk(id: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let mut bytes = id.to_vec();
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(body);
    if body.len() % 2 == 1 {
        bytes.push(0);
    }
    bytes
}

fn fmt(tag: u16, channels: u16, container: u16, bits: u16) -> Vec<u8> {
    let mut body = Vec::new();
    body.extend(tag.to_le_bytes());
    body.extend(channels.to_le_bytes());
    body.extend(8000_u32.to_le_bytes());
    body.extend((8000 * u32::from(container * channels)).to_le_bytes());
    body.extend((container * channels).to_le_bytes());
    body.extend(bits.to_le_bytes());
    chunk(b"fmt ", &body)
}

fn extensible(tag: u16, channels: u16, container: u16, valid: u16, mask: u32) -> Vec<u8> {
    let mut body = fmt(0xFFFE, channels, container, 8 * container)[8..].to_vec();
    body.extend(22_u16.to_le_bytes());
    body.extend(valid.to_le_bytes());
    body.extend(mask.to_le_bytes());
    body.extend(tag.to_le_bytes());
    body.extend([0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71]);
    chunk(b"fmt ", &body)
}

fn riff(chunks: &[Vec<u8>]) -> Vec<u8> {
    let body = chunks.concat();
    [b"RIFF".as_slice(), &(body.len() as u32 + 4).to_le_bytes(), b"WAVE", &body].concat()
}

fn pcm16(samples: &[i16]) -> Vec<u8> {
    samples.iter().flat_map(|s| s.to_le_bytes()).collect()
}

fn samples(bytes: &[u8]) -> Vec<f32> {
    read_all(bytes, 3).unwrap().1
}

#[test]
fn every_linear_format_maps_full_scale_to_one() {
    let file = |format, body: &[u8]| riff(&[format, chunk(b"data", body)]);
    assert_eq!(samples(&file(fmt(1, 1, 1, 8), &[0, 128, 192])), [-1.0, 0.0, 0.5]);
    assert_eq!(samples(&file(fmt(1, 1, 2, 16), &pcm16(&[-32_768, 0, 16_384]))), [-1.0, 0.0, 0.5]);
    assert_eq!(samples(&file(fmt(1, 1, 3, 24), &[0, 0, 0x80, 0, 0, 0x40])), [-1.0, 0.5]);
    assert_eq!(samples(&file(fmt(1, 1, 4, 32), &i32::MIN.to_le_bytes())), [-1.0]);
    assert_eq!(samples(&file(fmt(3, 1, 4, 32), &1.5_f32.to_le_bytes())), [1.5]);
    assert_eq!(samples(&file(fmt(3, 1, 8, 64), &(-0.1_f64).to_le_bytes())), [-0.1]);
    assert_eq!(samples(&file(extensible(3, 1, 4, 32, 4), &0.75_f32.to_le_bytes())), [0.75]);
}

#[test]
fn low_and_high_aligned_24_bit_samples_are_read() {
    let high = riff(&[extensible(1, 2, 4, 24, 3), chunk(b"data", &[0, 1, 0, 0x40, 0, 0xFF, 0xFF, 0xFF])]);
    let (info, read) = read_all(&high, 5).unwrap();
    assert_eq!(info.sample_format, SampleFormat::Int { bits: 24 });
    assert_eq!(info.channel_mask, Some(3));
    assert_eq!(read, [0.5 + 1.0 / 8_388_608.0, -1.0 / 8_388_608.0]);
    assert_eq!(info.warnings, []);
    let low = riff(&[extensible(1, 2, 4, 24, 3), chunk(b"data", &[1, 0, 0x40, 0, 0xFF, 0xFF, 0xFF, 0xFF])]);
    let (info, again) = read_all(&low, 5).unwrap();
    assert_eq!(again, read);
    assert_eq!(info.warnings, [AudioWarning::LowAligned24]);
}

#[test]
fn eight_channels_are_in_order() {
    let body: Vec<i16> = (0..24).map(|i| i * 256).collect();
    let file = riff(&[extensible(1, 8, 2, 16, 0x63F), chunk(b"data", &pcm16(&body))]);
    let (info, read) = read_all(&file, 2).unwrap();
    assert_eq!((info.channels, info.frames, info.channel_mask), (8, 3, Some(0x63F)));
    assert!(read.iter().zip(&body).all(|(&x, &s)| x == f32::from(s) / 32_768.0));
}

#[test]
fn chunks_are_found_in_any_order_with_or_without_padding() {
    let data = chunk(b"data", &pcm16(&[1, 2, 3]));
    let odd_chunk = chunk(b"LIST", b"odd");
    let unpadded = odd_chunk[..odd_chunk.len() - 1].to_vec();
    let fact = chunk(b"fact", &3_u32.to_le_bytes());
    let format = fmt(1, 1, 2, 16);
    let expected = [1.0, 2.0, 3.0].map(|x: f32| x / 32_768.0);
    for chunks in [
        vec![odd_chunk.clone(), format.clone(), fact.clone(), data.clone(), odd_chunk.clone()],
        vec![unpadded.clone(), format.clone(), unpadded.clone(), data.clone(), fact.clone()],
        vec![chunk(b"JUNK", &[0; 28]), format.clone(), chunk(b"xyz1", b"a"), data.clone()],
        vec![data.clone(), odd_chunk, format],
    ] {
        let (info, read) = read_all(&riff(&chunks), 2).unwrap();
        assert_eq!(read, expected);
        assert_eq!(info.warnings, []);
    }
}

#[test]
fn a_file_of_unknown_length_is_read_to_the_end() {
    for size in [0_u32, u32::MAX] {
        let mut data = chunk(b"data", &pcm16(&[5, 6, 7]));
        data[4..8].copy_from_slice(&size.to_le_bytes());
        let (info, _) = read_all(&riff(&[fmt(1, 1, 2, 16), data]), 2).unwrap();
        assert_eq!((info.frames, info.warnings), (3, vec![AudioWarning::UnknownLength]));
    }
    // An empty data chunk, followed by another chunk.
    let empty = riff(&[fmt(1, 1, 2, 16), chunk(b"data", b""), chunk(b"LIST", b"abcd")]);
    assert_eq!(read_all(&empty, 2).unwrap().0.frames, 0);
}

#[test]
fn a_length_in_the_header_is_limited_by_the_file() {
    let mut data = chunk(b"data", &pcm16(&[1; 9]));
    data[4..8].copy_from_slice(&40_000_u32.to_le_bytes());
    data.pop();
    let (info, read) = read_all(&riff(&[fmt(1, 2, 2, 16), data]), 2).unwrap();
    assert_eq!((info.frames, read.len()), (4, 8));
    let [differs, partial] = &info.warnings[..] else { panic!("{:?}", info.warnings) };
    assert_eq!(*differs, AudioWarning::LengthDiffers { header_frames: 10_000, frames: 4, rate: 8000 });
    assert_eq!(
        differs.to_string(),
        "the header states 10000 frames (1.250 s), the file has 4 (0.001 s): these are read"
    );
    assert_eq!(*partial, AudioWarning::PartialLastFrame { bytes: 1 });
}

#[test]
fn a_missing_64_bit_length_reads_to_the_end() {
    let mut data = chunk(b"data", &pcm16(&[1, 2, 3]));
    data[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    let file = riff(&[chunk(b"ds64", &[0; 28]), fmt(1, 1, 2, 16), data]);
    let (info, read) = read_all(&file, 2).unwrap();
    assert_eq!((info.frames, read.len()), (3, 3));
    assert!(info.warnings.contains(&AudioWarning::UnknownLength), "{:?}", info.warnings);
}

#[test]
fn a_chunk_whose_size_exceeds_the_file_is_skipped() {
    let (format, data) = (fmt(1, 1, 2, 16), chunk(b"data", &pcm16(&[1, 2, 3])));
    let mut list = chunk(b"LIST", b"INFOabcdefgh");
    list[4..8].copy_from_slice(&1_000_000_000_u32.to_le_bytes());
    for chunks in [[format.clone(), list.clone(), data.clone()], [list.clone(), format.clone(), data]] {
        let (info, read) = read_all(&riff(&chunks), 2).unwrap();
        assert_eq!((info.frames, read.len()), (3, 3));
        let text = info.warnings.iter().map(ToString::to_string).collect::<String>();
        assert!(text.contains("\"LIST\"") && text.contains("1000000000 bytes"), "{text}");
    }
    let file = riff(&[format, list]);
    let text = read_all(&file, 2).unwrap_err().to_string();
    assert!(text.contains("\"LIST\" at byte 36") && text.contains("no \"data\" chunk"), "{text}");
}

#[test]
fn rf64_and_bw64_have_the_length_of_ds64() {
    for id in [b"RF64", b"BW64"] {
        let mut sizes = [0; 28];
        sizes[8..16].copy_from_slice(&6_u64.to_le_bytes());
        let mut data = chunk(b"data", &pcm16(&[1, 2, 3]));
        data[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut file = riff(&[chunk(b"ds64", &sizes), fmt(1, 1, 2, 16), data, chunk(b"LIST", b"abcd")]);
        file[..4].copy_from_slice(id);
        let (info, _) = read_all(&file, 2).unwrap();
        assert_eq!((info.frames, info.warnings), (3, vec![]));
    }
}

#[test]
fn a_nan_is_named_with_its_frame() {
    let body: Vec<u8> = [0.0, 1.0, 2.0, f32::NAN].iter().flat_map(|x| x.to_le_bytes()).collect();
    let file = riff(&[fmt(3, 2, 4, 32), chunk(b"data", &body)]);
    let error = read_all(&file, 1).unwrap_err();
    assert!(matches!(error, AudioError::NotFinite { frame: 1, channel: 1, .. }), "{error}");
    let file = riff(&[fmt(3, 1, 8, 64), chunk(b"data", &1e300_f64.to_le_bytes())]);
    assert!(matches!(read_all(&file, 1), Err(AudioError::NotFinite { frame: 0, .. })));
}

#[test]
fn errors_name_the_reason() {
    let text = |file: &[u8]| open(file).err().unwrap().to_string();
    assert!(text(&riff(&[fmt(6, 1, 1, 8), chunk(b"data", b"ab")])).contains("A-law"));
    assert!(text(&riff(&[fmt(1, 1, 2, 16)])).contains("\"data\""));
    assert!(text(&riff(&[chunk(b"data", b"ab")])).contains("\"fmt \""));
    assert!(text(&riff(&[fmt(1, 0, 2, 16), chunk(b"data", b"ab")])).contains("0 channels"));
}

#[test]
fn a_seek_moves_to_the_frame() {
    let file = riff(&[fmt(1, 1, 2, 16), chunk(b"data", &pcm16(&[0, 8192, 16_384]))]);
    let mut reader = open(&file).unwrap();
    let mut out = [0.0; 2];
    reader.seek(1).unwrap();
    assert_eq!((reader.read(&mut out).unwrap(), out), (2, [0.25, 0.5]));
    reader.seek(3).unwrap();
    assert_eq!(reader.read(&mut out).unwrap(), 0);
    assert!(matches!(reader.seek(4), Err(AudioError::SeekPastEnd { frame: 4, frames: 3 })));
}

#[test]
fn files_of_hound_are_read() {
    for (bits, format) in [
        (8, hound::SampleFormat::Int),
        (16, hound::SampleFormat::Int),
        (24, hound::SampleFormat::Int),
        (32, hound::SampleFormat::Int),
        (32, hound::SampleFormat::Float),
    ] {
        let spec =
            hound::WavSpec { channels: 3, sample_rate: 44_100, bits_per_sample: bits, sample_format: format };
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut bytes, spec).unwrap();
        let values: Vec<i32> = (0..300).map(|i| (i * 7 % 255) - 128).collect();
        let scale = 2_f32.powi(i32::from(bits) - 1);
        for &v in &values {
            match format {
                hound::SampleFormat::Int => writer.write_sample(v).unwrap(),
                hound::SampleFormat::Float => writer.write_sample(v as f32 / scale).unwrap(),
            }
        }
        writer.finalize().unwrap();
        let (info, read) = read_all(bytes.get_ref(), 11).unwrap();
        assert_eq!((info.channels, info.rate, info.frames), (3, 44_100, 100));
        assert!(read.iter().zip(&values).all(|(&x, &v)| x == v as f32 / scale), "{bits} bits");
    }
}

/// Value of the bytes of a sample by the standard.
fn defined(tag: u16, low: bool, bytes: &[u8]) -> f32 {
    let four =
        |b: &[u8]| -> [u8; 4] { std::array::from_fn(|i| (i + b.len()).checked_sub(4).map_or(0, |k| b[k])) };
    let high = |b: &[u8]| (f64::from(i32::from_le_bytes(four(b))) / 2_147_483_648.0) as f32;
    match (tag, bytes) {
        (1, [a]) => (f32::from(*a) - 128.0) / 128.0,
        (1, [a, b, c, _]) if low => high(&[*a, *b, *c]),
        (1, _) => high(bytes),
        (_, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => f64::from_le_bytes(bytes.try_into().unwrap()) as f32,
    }
}

#[test]
fn every_layout_returns_the_same_bits_for_any_block_and_seek() {
    let random = Random::new(5, "samples");
    // Tag, bytes, valid bits, true for low-aligned.
    let layouts = [
        (1, 1, 8, false),
        (1, 2, 12, false),
        (1, 2, 16, false),
        (1, 3, 20, false),
        (1, 3, 24, false),
        (1, 4, 24, true),
        (1, 4, 24, false),
        (1, 4, 32, false),
        (3, 4, 32, false),
        (3, 8, 64, false),
    ];
    for (case, (tag, container, bits, low)) in layouts.into_iter().enumerate() {
        // More than one block of 64 KiB, and not a multiple of it.
        let frames = 70_003 / (3 * usize::from(container)) + 1;
        let body: Vec<u8> = (0..3 * frames)
            .flat_map(|n| {
                let [a, b, ..] = random.words(case as u32, n as u64, 0);
                let bytes = match (tag, container) {
                    (3, 4) => u64::from((a as f32 / 1e9 - 2.0).to_bits()),
                    (3, _) => (f64::from(a) / 1e9 - f64::from(b) / 1e12).to_bits(),
                    _ if low => u64::from(((a as i32) >> 8) as u32),
                    _ => u64::from(a),
                };
                bytes.to_le_bytes().into_iter().take(usize::from(container))
            })
            .collect();
        let file = riff(&[extensible(tag, 3, container, bits, 7), chunk(b"data", &body)]);
        let expected: Vec<u32> =
            body.chunks(usize::from(container)).map(|b| defined(tag, low, b).to_bits()).collect();
        let (info, all) = read_all(&file, frames).unwrap();
        assert_eq!(info.warnings.contains(&AudioWarning::LowAligned24), low);
        let found: Vec<u32> = all.iter().map(|x| x.to_bits()).collect();
        assert!(found == expected, "{tag} {container} {bits}");
        assert!(read_all(&file, 977).unwrap().1 == all, "{tag} {container} {bits}");
        let mut reader = open(&file).unwrap();
        let mut out = [0.0; 3 * 50];
        for at in [frames - 50, 1, frames / 2, 0] {
            reader.seek(at as u64).unwrap();
            assert_eq!(reader.read(&mut out).unwrap(), 50);
            assert_eq!(out, all[3 * at..3 * (at + 50)], "{tag} {container} {bits}");
        }
    }
}

/// More channels than the 16-bit size of a frame allows: the block size overflows, and the bits determine the container.
#[test]
fn frames_that_are_too_wide_for_the_header_are_read() {
    let channels = 40_000_u16;
    let mut format = fmt(1, 1, 4, 32);
    format[10..12].copy_from_slice(&channels.to_le_bytes());
    let body: Vec<u8> = (0..2 * i32::from(channels)).flat_map(|v| (v << 8).to_le_bytes()).collect();
    let file = riff(&[format, chunk(b"data", &body)]);
    let limits = ReadLimits { max_channels: 65_535, ..ReadLimits::default() };
    let mut reader = AudioReader::open_with(Box::new(Cursor::new(&file)), limits).unwrap();
    let mut out = vec![0.0; 2 * usize::from(channels)];
    assert_eq!((reader.info().frames, reader.read(&mut out).unwrap()), (2, 2));
    assert!(out.iter().enumerate().all(|(v, &x)| x == v as f32 / 8_388_608.0));
}

/// A header and an unlimited sequence of counting 16-bit samples, without memory.
struct Counting {
    header: Vec<u8>,
    len: u64,
    at: u64,
}

impl Read for Counting {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let n = (out.len() as u64).min(self.len.saturating_sub(self.at)) as usize;
        for out in &mut out[..n] {
            let header = self.header.len() as u64;
            *out = match self.at.checked_sub(header) {
                None => self.header[self.at as usize],
                Some(at) => ((at / 2) as u16).to_le_bytes()[(at % 2) as usize],
            };
            self.at += 1;
        }
        Ok(n)
    }
}

impl Seek for Counting {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::End(by) => self.len.saturating_add_signed(by),
            SeekFrom::Current(by) => self.at.saturating_add_signed(by),
        };
        Ok(self.at)
    }
}

#[test]
fn samples_after_four_gibibytes_are_read() {
    let frames = (1_u64 << 32) + 1001;
    let mut sizes = [0; 28];
    sizes[8..16].copy_from_slice(&(2 * frames).to_le_bytes());
    let mut header = riff(&[chunk(b"ds64", &sizes), fmt(1, 1, 2, 16), chunk(b"data", b"")]);
    header[..4].copy_from_slice(b"RF64");
    let size_at = header.len() - 4;
    header[size_at..].copy_from_slice(&u32::MAX.to_le_bytes());
    let source = Counting { len: header.len() as u64 + 2 * frames, at: 0, header };
    let limits = ReadLimits { max_seconds: f64::INFINITY, ..ReadLimits::default() };
    let mut reader = AudioReader::open_with(Box::new(source), limits).unwrap();
    assert_eq!((reader.info().frames, reader.info().warnings.len()), (frames, 0));
    let mut out = [0.0; 100];
    // Byte and frame offsets exceed 2^32 inside the block; then the end.
    for (at, count) in [((1 << 31) - 50, 100), ((1 << 32) - 50, 100), (frames - 30, 30)] {
        reader.seek(at).unwrap();
        assert_eq!(reader.read(&mut out).unwrap(), count);
        let expected = |n: usize| f32::from((at + n as u64) as i16) / 32_768.0;
        assert!(out[..count].iter().enumerate().all(|(n, &x)| x == expected(n)), "{at}");
    }
}
