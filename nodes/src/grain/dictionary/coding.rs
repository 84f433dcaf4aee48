//! Coding of samples in files.

/// Coding of samples in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Coding {
    /// 32-bit floats.
    Float = 0,
    /// 16-bit integers.
    Integer = 1,
    /// 16-bit integers as a FLAC stream of one channel.
    Flac = 2,
}

impl Coding {
    /// The coding of a byte of a file.
    pub fn of(byte: u8) -> Option<Self> {
        [Self::Float, Self::Integer, Self::Flac].into_iter().find(|coding| *coding as u8 == byte)
    }
}

/// Samples for each byte of a FLAC stream of grains that a file may claim.
pub const DENSEST: u64 = 256;

/// Encodes integers without loss, if this build has the coder and if it takes fewer bytes.
#[cfg(feature = "flac")]
pub fn flac(samples: &[i16]) -> Option<Vec<u8>> {
    use flacenc::component::BitRepr;
    use flacenc::error::Verify;
    // Streams have at least one block.
    let mut wide: Vec<i32> = samples.iter().map(|x| (*x).into()).collect();
    wide.resize(wide.len().max(SHORTEST), 0);
    let config = flacenc::config::Encoder::default().into_verified().ok()?;
    // Any rate: it is that of the dictionary.
    let source = flacenc::source::MemSource::from_samples(&wide, 1, 16, 44_100);
    let mut stream = flacenc::encode_with_fixed_block_size(&config, source, config.block_size).ok()?;
    // Decoders identify fixed blocks by the smallest block, which is that of all but the last one.
    stream.stream_info_mut().set_block_sizes(config.block_size, config.block_size).ok()?;
    let mut sink = flacenc::bitsink::ByteSink::new();
    stream.write(&mut sink).ok()?;
    let bytes = sink.as_slice().to_vec();
    (bytes.len() < 2 * samples.len()).then_some(bytes)
}

/// Samples of the shortest stream.
#[cfg(feature = "flac")]
const SHORTEST: usize = 64;

/// Encodes nothing: this build has no coder.
#[cfg(not(feature = "flac"))]
pub fn flac(_: &[i16]) -> Option<Vec<u8>> {
    None
}

/// Decodes such a stream into exactly `count` integers.
///
/// # Errors
/// Damage, another number of samples, and builds without the feature `flac`.
pub fn decode(bytes: &[u8], count: usize) -> Result<Vec<i16>, String> {
    let reader = crate::io::AudioReader::open(Box::new(std::io::Cursor::new(bytes)));
    let mut reader = reader.map_err(|e| e.to_string())?;
    let channels = reader.info().channels;
    if channels != 1 {
        return Err(format!("{channels} channels; one is needed"));
    }
    let (mut samples, mut block) = (Vec::new(), vec![0.0_f32; 4096]);
    loop {
        let n = reader.read(&mut block).map_err(|e| e.to_string())?;
        if n == 0 {
            break;
        }
        // 16-bit integers are exact in f32.
        samples.extend(block[..n].iter().map(|x| (x * 32_768.0).round() as i16));
        if samples.len() > count + 64 {
            return Err(format!("more than the {count} samples that are needed"));
        }
    }
    if samples.len() < count {
        return Err(format!("{} samples; {count} are needed", samples.len()));
    }
    samples.truncate(count);
    Ok(samples)
}

#[cfg(all(test, feature = "flac"))]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn integers_come_back_in_fewer_bytes() {
        let mut rng = Rng::new(4);
        for count in [64, 65, 1000, 4096, 4097, 30_000] {
            let x: Vec<i16> = (0..count).map(|_| (100.0 * rng.between(-1.0, 1.0)) as i16).collect();
            let Some(bytes) = flac(&x) else {
                assert!(count < 200, "{count}");
                continue;
            };
            assert!(count < 1000 || bytes.len() < x.len() * 6 / 5, "{count}: {}", bytes.len());
            assert_eq!(decode(&bytes, count).unwrap(), x);
            assert!(decode(&bytes, count + 100).unwrap_err().contains("are needed"));
            assert!(count < 200 || decode(&bytes, 100).unwrap_err().contains("more than"));
            assert!(decode(&bytes[..bytes.len() / 2], count).is_err());
        }
        let extremes: Vec<i16> = (0..5000).map(|k| [i16::MAX, -i16::MAX, 0][k % 3]).collect();
        assert!(flac(&extremes).is_none_or(|bytes| decode(&bytes, 5000).unwrap() == extremes));
        assert!(decode(b"nothing", 4).is_err());
    }
}
