//! Images from PNG, JPEG and TIFF: rejected, or of one sample per pixel. The corpus starts with the images of tests and
//! examples:
//! `mkdir -p fuzz/corpus/image; cargo +nightly fuzz run image fuzz/corpus/image nodes/src/texture/testdata graphs/assets/images`.
#![no_main]

use foley_nodes::texture::LumaKind;
use foley_nodes::texture::decode::decode;
use foley_nodes::texture::luma::luminance;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    // Larger ones are only slower.
    if let Ok(header) = foley_nodes::texture::decode::header(bytes)
        && header.width * header.height > 1 << 20
    {
        return;
    }
    if let Ok(picture) = decode(bytes)
        && let Ok((luma, holes)) = luminance(&picture, LumaKind::Lstar, false)
    {
        assert_eq!(luma.samples.len(), picture.width * picture.height);
        assert!(holes.is_empty() || holes.len() == luma.samples.len());
        assert!(luma.samples.iter().all(|x| (0.0..=100.01).contains(x)));
    }
});
