//! The code of a noise map, as a value node.

use super::detail::{extend, factor_for};
use super::profile::{PROFILE, profile, variance};
use super::spectrum::NoiseModel;
use super::split::statistics;
use crate::core::fault::Fault;
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::Params;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::Build;
use crate::texture::maps::{NoiseMap, NoiseProfile};
use crate::{choices, params, ports};

/// Most samples of synthesised noise before it is refined, and least.
const TABLE: usize = 1 << 16;
const SHORTEST: usize = 4096;

choices! {
    /// How noise is stored.
    pub enum NoiseCode {
        /// Samples along rows of the map: the paper.
        Profile,
        /// Its spectrum as 16 poles, its variance and, where it is spiky, its distribution: other noise of the same kind.
        Spectrum,
        /// Its spectrum as 32 bands of a quarter of an octave in place of the poles: nearer where a spectrum has steep edges.
        Bands,
    }
}

params! {
    /// One line of noise that stands for a noise map, closed to a loop at a known spacing.
    ///
    /// `Profile` reads rows of the map to and fro and joins them; `Spectrum` and `Bands` make other noise of the same spectrum. An image holds nothing
    /// finer than two pixels; `extend` goes on above that with the slope that the spectrum has in its upper two octaves, adding a
    /// quarter of the variance at most, until one sample of audio at `v_max` is one sample of the profile.
    ///
    /// A tap as `.bin` writes the samples as they are stored, in 16 bits each; as SVG it draws them.
    ///
    /// # Randomness
    /// Noise that is synthesised, and detail that is added, depend on the seed.
    ///
    /// # Source
    /// Picard, Tsingos and Faure (VRIPHYS 2008), section 4.2; van den Doel, Kry and Pai, "FoleyAutomatic" (SIGGRAPH 2001), for the spacing.
    pub struct NoiseProfileParams {
        /// How the noise is stored.
        code: NoiseCode = NoiseCode::Profile;
        /// Samples of a stored line, before detail is added: more of them repeat later.
        samples: usize = PROFILE, unit "samples", range 256..=262_144;
        /// Whether detail is added that the image does not hold.
        extend: bool = true;
        /// Highest speed that detail is made for.
        v_max: f64 = 2.0, unit "m/s", range 0.001..=1000.0;
    }
}

ports! {
    pub struct NoiseProfilePorts / NoiseProfileIo {
        in {
            /// The noise map.
            noise: Value<NoiseMap>,
        }
        out {
            /// The line of noise.
            profile: Value<NoiseProfile>,
        }
    }
}

/// The node over [`profile`], [`NoiseModel`] and [`extend`].
#[derive(Debug)]
pub struct NoiseProfileNode;

impl Func for NoiseProfileNode {
    type Params = NoiseProfileParams;
    type Ports = NoiseProfilePorts;
    const NAME: &'static str = "NoiseProfile";
    const VERSION: u32 = 2;

    fn eval(p: &NoiseProfileParams, cx: &Build<'_>, mut io: NoiseProfileIo<'_>) -> Result<Summary, Fault> {
        let finest = |profile: &NoiseProfile| if p.extend { factor_for(profile, p.v_max) } else { 1 };
        let (base, bytes) = match p.code {
            NoiseCode::Profile => (profile(io.noise, p.samples), 2 * p.samples),
            code => {
                let kurtosis = statistics(&io.noise.grid, &io.noise.holes).kurtosis;
                let fit = if code == NoiseCode::Bands { NoiseModel::bands } else { NoiseModel::poles };
                let model = fit(io.noise, kurtosis);
                let spacing = 1.0 / io.noise.surface.density[0];
                // The finer the detail, the shorter the loop: together they keep to one size.
                let coarse = NoiseProfile { samples: vec![0.0; SHORTEST], spacing };
                let count = (super::detail::MOST / finest(&coarse)).clamp(SHORTEST, TABLE);
                (NoiseProfile { samples: model.synthesize(count, &cx.random), spacing }, model.bytes())
            }
        };
        let (fine, told) = extend(&base, finest(&base), &cx.random);
        let summary = vec![
            ("bytes", bytes.into()),
            ("samples", fine.samples.len().into()),
            ("spacing_m", fine.spacing.into()),
            ("loop_m", (fine.spacing * fine.samples.len() as f64).into()),
            ("variance", variance(fine.samples.iter().copied()).into()),
            ("added_variance", told.added.into()),
            ("slope_db_per_octave", told.slope_db.into()),
        ];
        io.profile.set(fine);
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (NoiseProfileParams, MemoryFiles) {
        // Only high speeds, whose profiles are short.
        let (v_max, samples) = (rng.between(50.0, 1000.0), 256 + rng.below(9000));
        let p = NoiseProfileParams { v_max, samples, ..NoiseProfileParams::trial(rng) };
        (p, MemoryFiles::default())
    }
}

#[cfg(test)]
mod tests {
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
        let bytes = paper.file().unwrap();
        assert_eq!(bytes.len(), 16_384);
        let back = |pair: &[u8; 2]| half::f16::from_le_bytes(*pair).to_f32();
        assert!(bytes.as_chunks().0.iter().map(back).eq(paper.samples.iter().copied()));
    }

    #[test]
    fn detail_is_as_fine_as_audio_at_the_highest_speed() {
        for code in ["Profile", "Spectrum", "Bands"] {
            let fine = made(code, true);
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
    fn a_longer_line_repeats_later() {
        let long = made_of("Profile", false, 50_000);
        assert_eq!((long.samples.len(), long.spacing), (50_000, 1.0 / 512.0));
        assert!((variance(long.samples.iter().copied()) / 3.0 - 1.0).abs() < 0.02);
        assert_eq!(made_of("Profile", false, 256).samples.len(), 256);
    }
}
