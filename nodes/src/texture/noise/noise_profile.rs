//! The noise profile of a noise map, as a value node.

use super::detail::{MAX_EXTENDED, factor_for};
use super::profile::{PROFILE, profile, stored, variance};
use super::spectrum::NoiseModel;
use super::split::statistics;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::texture::maps::{Detail, NoiseMap, NoisePart, NoiseProfile, NoiseValue};
use crate::{choices, params, ports};

/// Maximum length of synthesised noise before its extension, in samples.
const MAX_LENGTH: usize = 1 << 16;
/// Minimum length of synthesised noise before its extension, in samples.
const MIN_LENGTH: usize = 4096;

choices! {
    /// Representation of noise.
    pub enum NoiseCode {
        /// Samples along rows of the map, as in the paper.
        Profile,
        /// The spectrum as 16 poles, the variance and, for a kurtosis above 4, the distribution: other noise with the same statistics.
        Spectrum,
        /// The spectrum as 32 bands of a quarter of an octave in place of the poles: more accurate for spectra with steep edges.
        Bands,
    }
}

choices! { @param NoisePart {
    /// The noise of the image, and the detail.
    Whole,
    /// The detail alone, to be added to a map of the image.
    Detail,
} }

params! {
    /// A profile of a noise map: a closed loop of samples at a known spacing.
    ///
    /// `Profile` joins rows of the map, read in alternating directions; `Spectrum` and `Bands` synthesise noise with the same spectrum.
    /// An image has no wavelengths below two pixels. `extend` continues the spectrum above that with the slope of its upper two
    /// octaves, until one sample of the profile is at most one sample of audio at `v_max`; it adds at most a quarter of the variance.
    ///
    /// A map of the image lacks the same wavelengths: `part: Detail` is the part to add to it.
    ///
    /// A tap as `.bin` writes the profile without its detail, as 16-bit floats, for `NoiseProfileFile`, which adds the same detail again; a
    /// tap as SVG draws it.
    ///
    /// # Randomness
    /// Synthesised noise and added detail depend on the seed.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2; van den Doel, Kry and Pai, "FoleyAutomatic" (SIGGRAPH 2001), for the spacing.
    pub struct NoiseProfileParams {
        /// Representation of the noise.
        code: NoiseCode = NoiseCode::Profile;
        /// Length of a stored profile before its extension: a longer one repeats later.
        samples: usize = PROFILE, unit "samples", range 256..=262_144;
        /// True to add detail finer than the image.
        extend: bool = true;
        /// Maximum speed of contacts, for the spacing of the added detail.
        v_max: f64 = 2.0, unit "m/s", range 0.001..=1000.0;
        /// Part of the spectrum that is read.
        part: NoisePart = NoisePart::Whole;
    }
}

ports! {
    pub struct NoiseProfilePorts / NoiseProfileIo {
        in {
            /// The noise map.
            noise: Value<NoiseMap>,
        }
        out {
            /// The profile.
            profile: Value<NoiseProfile>,
        }
    }
}

/// The node over [`profile`], [`NoiseModel`] and [`NoiseProfile::extended`].
#[derive(Debug)]
pub struct NoiseProfileNode;

impl Func for NoiseProfileNode {
    type Params = NoiseProfileParams;
    type Ports = NoiseProfilePorts;
    const NAME: &'static str = "NoiseProfile";
    const VERSION: u32 = 3;

    fn eval(p: &NoiseProfileParams, cx: &Build<'_>, mut io: NoiseProfileIo<'_>) -> Result<Summary, Fault> {
        let factor = |profile: &NoiseProfile| if p.extend { factor_for(profile, p.v_max) } else { 1 };
        let (mut base, bytes) = match p.code {
            NoiseCode::Profile => (profile(io.noise, p.samples), 2 * p.samples),
            code => {
                let kurtosis = statistics(&io.noise.grid, &io.noise.holes).kurtosis;
                let fit = if code == NoiseCode::Bands { NoiseModel::bands } else { NoiseModel::poles };
                let model = fit(io.noise, kurtosis);
                let spacing = 1.0 / io.noise.surface.density[0];
                // A larger factor gets a shorter loop, within the same maximum size.
                let coarse =
                    NoiseProfile { samples: vec![0.0; MIN_LENGTH], spacing, ..NoiseProfile::default() };
                let count = (MAX_EXTENDED / factor(&coarse)).clamp(MIN_LENGTH, MAX_LENGTH);
                let samples = model.synthesize(count, &cx.random);
                // What plays is what a file stores.
                let samples = samples.into_iter().map(|x| stored(x).to_f32()).collect();
                (NoiseProfile { samples, spacing, ..NoiseProfile::default() }, model.bytes())
            }
        };
        let [low, high, ..] = cx.random.words(2, 0, 0);
        let seed = u64::from(low) | u64::from(high) << 32;
        base.detail = Some(Detail { factor: factor(&base) as u32, seed }).filter(|detail| detail.factor > 1);
        let (fine, extension) = base.extended(NoiseValue::Height);
        base.part = p.part;
        let summary = vec![
            ("bytes", bytes.into()),
            ("samples", fine.samples.len().into()),
            ("spacing_m", fine.spacing.into()),
            ("loop_m", (fine.spacing * fine.samples.len() as f64).into()),
            ("variance", variance(fine.samples.iter().copied()).into()),
            ("added_variance", extension.added.into()),
            ("slope_db_per_octave", extension.slope_db.into()),
        ];
        io.profile.set(base);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (NoiseProfileParams, MemoryFiles) {
        // High speeds only, which have short profiles.
        let (v_max, samples) = (rng.between(50.0, 1000.0), 256 + rng.below(9000));
        let p = NoiseProfileParams { v_max, samples, ..NoiseProfileParams::trial(rng) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise_profile_file::decode_profile;
    use super::*;
    use crate::core::item::Data;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;
    use crate::texture::{Grid, Surface};

    fn made(code: &str, extend: bool) -> NoiseProfile {
        made_of(code, extend, PROFILE)
    }

    fn made_of(code: &str, extend: bool, samples: usize) -> NoiseProfile {
        let mut rng = Rng::new(4);
        let grid = Grid::from_fn(256, 256, |_, _| rng.between(-3.0, 3.0) as f32);
        let get = |name: &str| match name {
            "samples" => Some(Datum::Int(samples as i64)),
            "code" => Some(Datum::Name(code.into())),
            "extend" => Some(Datum::Bool(extend)),
            _ => None,
        };
        let standalone = Standalone::func::<NoiseProfileNode>(NoiseProfileParams::read(&get).unwrap());
        let map = NoiseMap { grid, holes: Vec::new(), surface: Surface::default() };
        let run = standalone.value(NoiseProfilePorts::noise, map).run().unwrap();
        run.value(0).unwrap().get::<NoiseProfile>().unwrap().clone()
    }

    #[test]
    fn stored_profiles_take_16_kb_and_lose_nothing_in_16_bits() {
        let paper = made("Profile", false);
        assert_eq!((paper.samples.len(), paper.spacing), (8192, 1.0 / 512.0));
        for profile in [paper, made("Profile", true), made("Spectrum", true)] {
            let bytes = profile.file().unwrap();
            assert!(bytes.len() <= 2 * profile.samples.len() + 64, "{} bytes", bytes.len());
            assert_eq!(decode_profile(&bytes).unwrap(), profile);
        }
    }

    #[test]
    fn the_spacing_of_detail_is_that_of_audio_at_the_highest_speed() {
        for code in ["Profile", "Spectrum", "Bands"] {
            let fine = made(code, true).line(NoiseValue::Height);
            assert!(fine.spacing <= 2.0 / 44_100.0, "{code}: {}", fine.spacing);
            assert!(
                fine.samples.len() <= 1 << 20
                    && (variance(fine.samples.iter().copied()) / 3.0 - 1.0).abs() < 0.3
            );
        }
        let plain = made("Spectrum", false);
        assert_eq!(plain.samples.len(), 1 << 16);
        assert!((variance(plain.samples.iter().copied()) / 3.0 - 1.0).abs() < 0.02);
    }

    #[test]
    fn a_profile_has_the_length_of_its_parameter() {
        let long = made_of("Profile", false, 50_000);
        assert_eq!((long.samples.len(), long.spacing), (50_000, 1.0 / 512.0));
        assert!((variance(long.samples.iter().copied()) / 3.0 - 1.0).abs() < 0.02);
        assert_eq!(made_of("Profile", false, 256).samples.len(), 256);
    }
}
