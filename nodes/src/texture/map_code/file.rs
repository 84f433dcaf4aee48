//! Coded maps as data of ports and as files.
//!
//! A file holds, little endian: `fMAP`; version, coding and border, one byte each; columns, rows and scale in 32 bits each; pixels
//! per metre along x and y, and depth, in 64 bits each; the code.

use super::code::{CodedMap, Coding};
use crate::core::item::Data;
use crate::core::random::Rng;
use crate::texture::figure::picture::picture;
use crate::texture::grid::Wrap;
use crate::texture::maps::{DiscontinuityMap, Surface};

/// First bytes of a file.
const MAGIC: &[u8; 4] = b"fMAP";
const VERSION: u8 = 1;
/// Maximum side of a map, in pixels.
const MAX_SIDE: u32 = 1 << 20;

/// Length of the code of a map in bytes; `None` on overflow.
fn code_bytes(coding: Coding, width: usize, height: usize) -> Option<usize> {
    let pixels = width.checked_mul(height)?;
    match coding {
        Coding::Signed => pixels.checked_mul(2),
        Coding::Byte => Some(pixels),
        Coding::Bit => Some(pixels.div_ceil(8)),
    }
}

/// Writes a coded map as bytes.
#[must_use]
pub fn encode_map(map: &CodedMap) -> Vec<u8> {
    let mut out = Vec::with_capacity(43 + map.bytes.len());
    out.extend_from_slice(MAGIC);
    let coding = match map.coding {
        Coding::Signed => 0,
        Coding::Byte => 1,
        Coding::Bit => 2,
    };
    let wrap = match map.surface.wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    out.extend_from_slice(&[VERSION, coding, wrap]);
    for side in [map.width, map.height] {
        out.extend_from_slice(&u32::try_from(side).unwrap_or(u32::MAX).to_le_bytes());
    }
    out.extend_from_slice(&map.scale.to_le_bytes());
    let [x, y] = map.surface.density;
    for number in [x, y, map.surface.depth] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(&map.bytes);
    out
}

/// Reads a coded map from bytes.
///
/// # Errors
/// A message with the defect.
pub fn decode_map(bytes: &[u8]) -> Result<CodedMap, String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("this is not a coded map: it does not begin with `fMAP`")?;
    match rest.first() {
        Some(&VERSION) => {}
        Some(version) => return Err(format!("version {version}; this foley reads version {VERSION}")),
        None => return Err("it ends in its first bytes".into()),
    }
    let (map, code) = header(rest.get(1..).unwrap_or_default())
        .ok_or("it ends in its header, or has an impossible size or density")?;
    let wanted = code_bytes(map.coding, map.width, map.height);
    if wanted != Some(code.len()) {
        return Err(format!(
            "it is damaged: {} bytes of code for {} x {} pixels as {:?}",
            code.len(),
            map.width,
            map.height,
            map.coding
        ));
    }
    Ok(CodedMap { bytes: code.to_vec(), ..map })
}

/// Removes and returns the first `N` bytes.
fn first<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (chunk, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*chunk)
}

/// A map without its code, and the code.
fn header(mut bytes: &[u8]) -> Option<(CodedMap, &[u8])> {
    let from = &mut bytes;
    let [coding, wrap] = first(from)?;
    let coding = *[Coding::Signed, Coding::Byte, Coding::Bit].get(usize::from(coding))?;
    let wrap = *[Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].get(usize::from(wrap))?;
    let [width, height] = [u32::from_le_bytes(first(from)?), u32::from_le_bytes(first(from)?)];
    let scale = f32::from_le_bytes(first(from)?);
    let [x, y, depth] = [
        f64::from_le_bytes(first(from)?),
        f64::from_le_bytes(first(from)?),
        f64::from_le_bytes(first(from)?),
    ];
    let sizes = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    let scaled = [x, y].iter().all(|d| d.is_finite() && *d > 0.0) && depth.is_finite() && depth >= 0.0;
    let map = CodedMap {
        coding,
        width: width as usize,
        height: height as usize,
        scale,
        bytes: Vec::new(),
        surface: Surface { density: [x, y], depth, wrap },
    };
    (sizes && scaled && scale.is_finite() && scale >= 0.0).then_some((map, bytes))
}

impl Data for CodedMap {
    const NAME: &'static str = "coded map";
    const PLOTS: bool = true;
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let coding = [Coding::Signed, Coding::Byte, Coding::Bit][rng.below(3)];
        Self::new(&DiscontinuityMap::trial(rng), coding, None)
    }

    fn plot(&self) -> Option<String> {
        let title = format!("Stored map: {:?}, {} bytes", self.coding, self.bytes.len());
        picture(&title, &self.magnitude(), [0.0, 1.0], &self.surface)
    }

    fn file(&self) -> Option<Vec<u8>> {
        Some(encode_map(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_of_all_codings_are_read_again() {
        let mut rng = Rng::new(7);
        for _ in 0..20 {
            let map = CodedMap::trial(&mut rng);
            let bytes = encode_map(&map);
            assert_eq!(bytes.len(), 43 + map.bytes.len());
            assert_eq!(decode_map(&bytes).unwrap(), map);
        }
    }

    #[test]
    fn damaged_files_are_refused_and_never_panic() {
        assert!(decode_map(b"").unwrap_err().contains("fMAP"));
        assert!(decode_map(b"fMAP").unwrap_err().contains("first bytes"));
        assert!(decode_map(b"fMAP\x09").unwrap_err().contains("version 9"));
        assert!(decode_map(b"fMAP\x01ab").unwrap_err().contains("header"));
        let mut rng = Rng::new(2);
        let good = encode_map(&CodedMap::trial(&mut rng));
        assert!(decode_map(&good[..good.len() - 1]).unwrap_err().contains("damaged"));
        assert!(decode_map(&[&good[..], &[0]].concat()).unwrap_err().contains("damaged"));
        // An invalid coding, border, width, height, scale and density.
        let invalid: [(usize, &[u8]); 6] =
            [(5, &[3]), (6, &[7]), (7, &[0; 4]), (11, &[0xFF; 4]), (15, &[0xFF; 4]), (19, &[0; 8])];
        for (at, with) in invalid {
            let mut bad = good.clone();
            bad[at..at + with.len()].copy_from_slice(with);
            assert!(decode_map(&bad).unwrap_err().contains("header"), "{at}");
        }
        let mut wide = good.clone();
        wide[9] = 1;
        assert!(decode_map(&wide).unwrap_err().contains("damaged"), "more pixels than bytes");
        for _ in 0..5000 {
            let mut bad = good.clone();
            for _ in 0..1 + rng.below(4) {
                let at = rng.below(bad.len().min(60));
                bad[at] = rng.below(256) as u8;
            }
            bad.truncate(bad.len() - rng.below(3));
            if let Ok(map) = decode_map(&bad) {
                let (magnitude, gradient) = (map.magnitude(), map.gradient());
                assert_eq!(magnitude.samples.len(), map.width * map.height);
                assert!(magnitude.samples.iter().all(|m| (0.0..=1.0).contains(m)));
                assert!(gradient.is_none_or(|g| g.gx.samples.iter().all(|x| x.is_finite())));
            }
        }
    }
}
