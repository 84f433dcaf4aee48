//! Tests of reading images.

use super::*;
use crate::core::random::Rng;

/// Writes a PNG, for tests.
pub(in crate::texture) fn png(
    width: u32,
    height: u32,
    colour: png::ColorType,
    words: bool,
    data: &[u8],
) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(colour);
    encoder.set_depth(if words { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
    if colour == png::ColorType::Indexed {
        encoder.set_palette(vec![0, 0, 0, 255, 255, 255, 255, 0, 0]);
        encoder.set_trns(vec![255, 255, 0]);
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    out
}

fn tiff(colour: u16, samples: &[u8]) -> Vec<u8> {
    use tiff::encoder::{TiffEncoder, colortype};
    let mut out = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut out).unwrap();
    match colour {
        1 => encoder.write_image::<colortype::Gray8>(3, 2, samples).unwrap(),
        _ => encoder.write_image::<colortype::RGB8>(1, 2, samples).unwrap(),
    }
    out.into_inner()
}

/// An 8 x 8 grey JPEG of the level 129 at quality 90, as Pillow writes it.
const JPEG: &[u8] = include_bytes!("../../testdata/grey.jpg");
/// A 16 x 9 colour JPEG with halved colour, as Pillow writes it: orange with a blue corner.
const COLOUR: &[u8] = include_bytes!("../../testdata/colour.jpg");

#[test]
fn every_kind_of_png_is_read() {
    use png::ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
    for (colour, channels) in [(Grayscale, 1), (GrayscaleAlpha, 2), (Rgb, 3), (Rgba, 4)] {
        let data: Vec<u8> = (0..6 * channels as u8).map(|k| k * 7).collect();
        let picture = decode(&png(3, 2, colour, false, &data)).unwrap();
        assert_eq!((picture.width, picture.height, picture.channels), (3, 2, channels));
        assert_eq!(picture.samples, Samples::Bytes(data.clone()));
        let wide: Vec<u8> = data.iter().flat_map(|k| [*k, 9]).collect();
        let words = data.iter().map(|k| u16::from(*k) * 256 + 9).collect();
        assert_eq!(decode(&png(3, 2, colour, true, &wide)).unwrap().samples, Samples::Words(words));
    }
    let palette = decode(&png(3, 1, Indexed, false, &[0, 1, 2])).unwrap();
    assert_eq!(palette.samples, Samples::Bytes(vec![0, 0, 0, 255, 255, 255, 255, 255, 255, 0, 0, 0]));
}

#[test]
fn jpeg_and_tiff_are_read() {
    let grey = decode(JPEG).unwrap();
    assert_eq!((grey.width, grey.height, grey.channels, grey.format), (8, 8, 1, Format::Jpeg));
    let Samples::Bytes(samples) = grey.samples else { panic!("8 bits") };
    assert!(samples.iter().all(|x| x.abs_diff(129) <= 1), "{samples:?}");
    let colour = decode(COLOUR).unwrap();
    assert_eq!((colour.width, colour.height, colour.channels), (16, 9, 3));
    let Samples::Bytes(samples) = colour.samples else { panic!("8 bits") };
    let orange = samples.last_chunk::<3>().unwrap();
    assert!(orange.iter().zip([230, 140, 20]).all(|(a, b)| a.abs_diff(b) < 12), "{orange:?}");
    let data = [1, 2, 3, 4, 5, 6];
    let grey = decode(&tiff(1, &data)).unwrap();
    assert_eq!((grey.width, grey.height, grey.channels, grey.format), (3, 2, 1, Format::Tiff));
    assert_eq!(grey.samples, Samples::Bytes(data.to_vec()));
    assert_eq!(decode(&tiff(3, &data)).unwrap().channels, 3);
}

/// A TIFF of two pixels of grey with alpha, which the encoder does not support.
fn grey_and_alpha(bits: u8, samples: &[u8]) -> Vec<u8> {
    let short = |tag: u16, values: [u16; 2], count: u32| {
        let [tag, kind] = [tag, 3].map(u16::to_le_bytes);
        [&tag[..], &kind, &count.to_le_bytes(), &values[0].to_le_bytes(), &values[1].to_le_bytes()].concat()
    };
    let bits = u16::from(bits);
    // Width, height, bits, no compression, black is 0, offset of the samples, channels, rows, bytes, and an alpha channel.
    let tags = [
        short(256, [2, 0], 1),
        short(257, [1, 0], 1),
        short(258, [bits, bits], 2),
        short(259, [1, 0], 1),
        short(262, [1, 0], 1),
        short(273, [134, 0], 1),
        short(277, [2, 0], 1),
        short(278, [1, 0], 1),
        short(279, [samples.len() as u16, 0], 1),
        short(338, [2, 0], 1),
    ];
    [&b"II\x2a\0\x08\0\0\0\x0a\0"[..], &tags.concat(), &[0; 4], samples].concat()
}

#[test]
fn a_tiff_of_grey_and_alpha_has_holes_where_it_is_transparent() {
    use crate::texture::LumaKind;
    use crate::texture::image::luma::luminance;
    let bytes = decode(&grey_and_alpha(8, &[119, 255, 200, 10])).unwrap();
    assert_eq!((bytes.width, bytes.height, bytes.channels, bytes.format), (2, 1, 2, Format::Tiff));
    assert_eq!(bytes.samples, Samples::Bytes(vec![119, 255, 200, 10]));
    let words = [119 * 257_u16, 65_535, 51_400, 2570];
    let wide: Vec<u8> = words.iter().flat_map(|x| x.to_le_bytes()).collect();
    let wide = decode(&grey_and_alpha(16, &wide)).unwrap();
    assert_eq!(wide.samples, Samples::Words(words.to_vec()));
    for picture in [bytes, wide] {
        let (luma, holes) = luminance(&picture, LumaKind::Lstar, false).unwrap();
        assert!((luma.samples[0] - 50.0).abs() < 0.1 && luma.samples[1] == 0.0, "{:?}", luma.samples);
        assert_eq!(holes, [false, true]);
    }
}

/// The JPEG with an Exif block after its first two bytes.
fn rotated_jpeg(orientation: u8) -> Vec<u8> {
    let exif: &[u8] =
        &[b'M', b'M', 0, 42, 0, 0, 0, 8, 0, 1, 1, 18, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0, 0, 0, 0, 0];
    [&COLOUR[..2], &[0xff, 0xe1, 0, exif.len() as u8 + 8], b"Exif\0\0", exif, &COLOUR[2..]].concat()
}

#[test]
fn photographs_are_rotated_upright() {
    let plain = decode(COLOUR).unwrap();
    assert_eq!(decode(&rotated_jpeg(1)).unwrap(), plain);
    let rotated = decode(&rotated_jpeg(6)).unwrap();
    assert_eq!((rotated.width, rotated.height), (9, 16));
    let (Samples::Bytes(before), Samples::Bytes(after)) = (&plain.samples, &rotated.samples) else {
        panic!("8 bits")
    };
    // The left side becomes the top, and the bottom the left side.
    assert_eq!(after[..3], before[8 * 16 * 3..][..3]);
    assert_eq!(after[8 * 3..][..3], before[..3]);
    assert_ne!(after[..3], after[8 * 3..][..3], "one corner is blue");
}

#[test]
fn a_tiff_of_separate_planes_is_unsupported_and_not_damaged() {
    // Two pixels of red, then of green, then of blue, as tifffile writes them.
    let text = code(include_bytes!("../../testdata/planes.tif"));
    assert!(text.0 == "F123" && text.1.contains("separate plane"), "{text:?}");
}

fn code(bytes: &[u8]) -> (&'static str, String) {
    let e = decode(bytes).unwrap_err();
    (e.code(), e.to_string())
}

#[test]
fn errors_name_what_was_found_and_what_would_be_right() {
    let (c, text) = code(b"");
    assert!(c == "F120" && text.contains("empty") && text.contains("PNG, JPEG and TIFF"), "{text}");
    let (c, text) = code(b"RIFF....WEBP");
    assert!(c == "F120" && text.contains("52 49 46 46"), "{text}");
    let whole = png(30, 20, png::ColorType::Grayscale, false, &[7; 600]);
    let (c, text) = code(&whole[..whole.len() - 20]);
    assert!(c == "F122" && text.contains("PNG"), "{text}");
    let (c, _) = code(&JPEG[..JPEG.len() - 12]);
    assert_eq!(c, "F122");
    let (c, text) = code(&tiff(1, &[1, 2, 3, 4, 5, 6])[..40]);
    assert!(c == "F122", "{text}");
}

/// A PNG of one pixel with another size in its header and the right checksum.
fn with_size(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = png(1, 1, png::ColorType::Grayscale, false, &[0]);
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let crc = bytes[12..29]
        .iter()
        .fold(u32::MAX, |crc, b| (0..8).fold(crc ^ u32::from(*b), |c, _| (c >> 1) ^ (0xedb8_8320 * (c & 1))));
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

#[test]
fn implausible_sizes_in_a_header_are_refused() {
    let (c, text) = code(&with_size(16_385, 1));
    assert!(c == "F121" && text.contains("16385 x 1"), "{text}");
    assert_eq!(code(&with_size(16_384, 16_384)).0, "F121");
    assert_eq!(code(&with_size(u32::MAX >> 1, u32::MAX >> 1)).0, "F121");
    let (c, text) = code(&with_size(8192, 8192));
    assert!(c == "F122" && text.contains("cannot hold 8192 x 8192"), "{text}");
    assert_eq!(code(&with_size(2, 2)).0, "F122", "one pixel where four were announced");
}

#[test]
fn damaged_files_give_an_image_or_an_error() {
    let seeds = [
        png(5, 4, png::ColorType::Rgba, false, &[99; 80]),
        png(3, 1, png::ColorType::Indexed, false, &[0, 1, 2]),
        png(4, 2, png::ColorType::Rgb, true, &[5; 48]),
        JPEG.to_vec(),
        COLOUR.to_vec(),
        tiff(1, &[1, 2, 3, 4, 5, 6]),
        crate::texture::image::palette::tests::tiff(4, true),
        crate::texture::image::palette::tests::tiff(8, false),
    ];
    let mut rng = Rng::new(120);
    let (mut read, mut refused) = (0, 0);
    for k in 0..3000 {
        let mut bytes = seeds[k % seeds.len()].clone();
        for _ in 0..=rng.below(4) {
            let at = rng.below(bytes.len());
            match rng.below(5) {
                0 => bytes.truncate(at.max(1)),
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, rng.below(256) as u8),
                3 => bytes[at] ^= 1 << rng.below(8),
                _ => bytes[at] = [0, 1, 0x7f, 0x80, 0xff, 0xd9][rng.below(6)],
            }
            if bytes.is_empty() {
                break;
            }
        }
        match decode(&bytes) {
            Ok(picture) => {
                read += 1;
                let count = match &picture.samples {
                    Samples::Bytes(samples) => samples.len(),
                    Samples::Words(samples) => samples.len(),
                };
                assert_eq!(count, picture.width * picture.height * picture.channels);
            }
            Err(e) => {
                refused += 1;
                assert!(!e.to_string().is_empty());
            }
        }
    }
    assert!(read > 50 && refused > 500, "{read} read, {refused} refused");
}
