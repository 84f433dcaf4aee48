//! Palettes in TIFF and PNG.

use crate::texture::image::decode::{Samples, decode};

/// A TIFF of 5 x 2 pixels with the palette indices 0, 1, 2, ... (0, 1, 0, 1, ... for one bit).
pub(in crate::texture::image) fn tiff(bits: u16, little: bool) -> Vec<u8> {
    let short = |x: u16| if little { x.to_le_bytes() } else { x.to_be_bytes() };
    let long = |x: u32| if little { x.to_le_bytes() } else { x.to_be_bytes() };
    let colours = 1_u32 << bits;
    let mut data = vec![0_u8; 2 * (5 * usize::from(bits)).div_ceil(8)];
    let each = data.len() / 2;
    for k in 0..10_usize {
        let (x, number) = (k % 5, k as u32 % colours);
        let offset = x * usize::from(bits);
        data[k / 5 * each + offset / 8] |= (number as u8) << (8 - usize::from(bits) - offset % 8);
    }
    let map_at = 8 + data.len() as u32 + data.len() as u32 % 2;
    let start = map_at + 6 * colours;
    let mut out = if little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
    out.extend(long(start));
    out.extend(&data);
    out.resize(map_at as usize, 0);
    for channel in 0..3_u32 {
        (0..colours).for_each(|k| out.extend(short((k * 250 + 9 * channel + 1) as u16)));
    }
    let entries: [(u16, u16, u32, u32); 9] = [
        (256, 4, 1, 5),
        (257, 4, 1, 2),
        (258, 3, 1, bits.into()),
        (259, 3, 1, 1),
        (262, 3, 1, 3),
        (273, 4, 1, 8),
        (278, 4, 1, 2),
        (279, 4, 1, data.len() as u32),
        (320, 3, 3 * colours, map_at),
    ];
    out.extend(short(entries.len() as u16));
    for (tag, kind, count, value) in entries {
        out.extend(short(tag));
        out.extend(short(kind));
        out.extend(long(count));
        if kind == 3 && count == 1 {
            out.extend(short(value as u16));
            out.extend([0; 2]);
        } else {
            out.extend(long(value));
        }
    }
    out.extend(long(0));
    out
}

#[test]
fn indices_become_colours_at_any_depth_and_byte_order() {
    for bits in [1, 2, 4, 8] {
        for little in [true, false] {
            let picture = decode(&tiff(bits, little)).unwrap();
            assert_eq!((picture.width, picture.height, picture.channels), (5, 2, 3));
            let right =
                (0..10_u16).flat_map(|k| [0, 1, 2].map(|c| k % (1 << bits) * 250 + 9 * c + 1)).collect();
            assert_eq!(picture.samples, Samples::Words(right), "{bits} bits, little {little}");
        }
    }
}

#[test]
fn the_error_of_an_unsupported_palette_has_a_remedy() {
    let mut deep = tiff(8, true);
    let at = deep.windows(4).position(|w| w == [2, 1, 3, 0]).unwrap();
    deep[at + 8] = 16;
    let e = decode(&deep).unwrap_err();
    assert!(e.code() == "F123" && e.to_string().contains("convert it to RGB"), "{e}");
    // Too few colours.
    let mut poor = tiff(4, true);
    let at = poor.windows(4).position(|w| w == [64, 1, 3, 0]).unwrap();
    poor[at + 4] = 30;
    let e = decode(&poor).unwrap_err();
    assert!(e.code() == "F122" && e.to_string().contains("30 numbers for 16 colours"), "{e}");
}
