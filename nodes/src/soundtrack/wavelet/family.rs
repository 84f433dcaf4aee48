//! Orthogonal wavelets and their filters.

use crate::choices;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// An orthogonal wavelet with compact support.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wavelet {
    /// One vanishing moment: exact in time, coarse in frequency.
    Haar,
    /// Daubechies, 2 vanishing moments.
    Db2,
    /// Daubechies, 3 vanishing moments.
    Db3,
    /// Daubechies, 4 vanishing moments.
    Db4,
    /// Daubechies, 5 vanishing moments.
    Db5,
    /// Daubechies, 6 vanishing moments.
    Db6,
    /// Daubechies, 7 vanishing moments.
    Db7,
    /// Daubechies, 8 vanishing moments.
    Db8,
    /// Daubechies, 9 vanishing moments.
    Db9,
    /// Daubechies, 10 vanishing moments.
    Db10,
    /// Least asymmetric Daubechies, 2 vanishing moments.
    Sym2,
    /// Least asymmetric Daubechies, 3 vanishing moments.
    Sym3,
    /// Least asymmetric Daubechies, 4 vanishing moments.
    Sym4,
    /// Least asymmetric Daubechies, 5 vanishing moments.
    Sym5,
    /// Least asymmetric Daubechies, 6 vanishing moments.
    Sym6,
    /// Least asymmetric Daubechies, 7 vanishing moments.
    Sym7,
    /// Least asymmetric Daubechies, 8 vanishing moments.
    Sym8,
    /// Least asymmetric Daubechies, 9 vanishing moments.
    Sym9,
    /// Least asymmetric Daubechies, 10 vanishing moments.
    Sym10,
}

choices! { @param Wavelet {
    /// One vanishing moment: exact in time, coarse in frequency.
    Haar,
    /// Daubechies, 2 vanishing moments.
    Db2,
    /// Daubechies, 3 vanishing moments.
    Db3,
    /// Daubechies, 4 vanishing moments.
    Db4,
    /// Daubechies, 5 vanishing moments.
    Db5,
    /// Daubechies, 6 vanishing moments.
    Db6,
    /// Daubechies, 7 vanishing moments.
    Db7,
    /// Daubechies, 8 vanishing moments.
    Db8,
    /// Daubechies, 9 vanishing moments.
    Db9,
    /// Daubechies, 10 vanishing moments.
    Db10,
    /// Least asymmetric Daubechies, 2 vanishing moments.
    Sym2,
    /// Least asymmetric Daubechies, 3 vanishing moments.
    Sym3,
    /// Least asymmetric Daubechies, 4 vanishing moments.
    Sym4,
    /// Least asymmetric Daubechies, 5 vanishing moments.
    Sym5,
    /// Least asymmetric Daubechies, 6 vanishing moments.
    Sym6,
    /// Least asymmetric Daubechies, 7 vanishing moments.
    Sym7,
    /// Least asymmetric Daubechies, 8 vanishing moments.
    Sym8,
    /// Least asymmetric Daubechies, 9 vanishing moments.
    Sym9,
    /// Least asymmetric Daubechies, 10 vanishing moments.
    Sym10,
} }

impl Wavelet {
    /// Returns the low-pass filter of the synthesis, whose coefficients add up to the square root of 2.
    ///
    /// # Source
    /// Daubechies, "Ten Lectures on Wavelets" (SIAM 1992), tables 6.1 and 6.3, with the digits of PyWavelets 1.8.
    #[must_use]
    pub fn low_pass(self) -> &'static [f64] {
        match self {
            Self::Haar => &[FRAC_1_SQRT_2, FRAC_1_SQRT_2],
            Self::Db2 => &[0.48296291314453416, 0.8365163037378079, 0.2241438680420134, -0.12940952255126037],
            Self::Db3 => &[
                0.33267055295008263,
                0.8068915093110925,
                0.45987750211849154,
                -0.13501102001025458,
                -0.08544127388202666,
                0.03522629188570953,
            ],
            Self::Db4 => &[
                0.2303778133088965,
                0.7148465705529157,
                0.6308807679298589,
                -0.027983769416859854,
                -0.18703481171909309,
                0.030841381835560764,
                0.0328830116668852,
                -0.010597401785069032,
            ],
            Self::Db5 => &[
                0.16010239797419293,
                0.6038292697971896,
                0.7243085284377729,
                0.13842814590132074,
                -0.24229488706638203,
                -0.032244869584638375,
                0.07757149384004572,
                -0.006241490212798274,
                -0.012580751999081999,
                0.0033357252854737712,
            ],
            Self::Db6 => &[
                0.11154074335010947,
                0.49462389039845306,
                0.7511339080210954,
                0.31525035170919763,
                -0.22626469396543983,
                -0.12976686756726194,
                0.09750160558732304,
                0.027522865530305727,
                -0.03158203931748603,
                0.0005538422011614961,
                0.004777257510945511,
                -0.0010773010853084796,
            ],
            Self::Db7 => &[
                0.07785205408500918,
                0.3965393194819173,
                0.7291320908462351,
                0.4697822874051931,
                -0.14390600392856498,
                -0.22403618499387498,
                0.07130921926683026,
                0.08061260915108308,
                -0.03802993693501441,
                -0.01657454163066688,
                0.01255099855609984,
                0.0004295779729213665,
                -0.0018016407040474908,
                0.00035371379997452024,
            ],
            Self::Db8 => &[
                0.05441584224310401,
                0.31287159091429995,
                0.6756307362972898,
                0.5853546836542067,
                -0.015829105256349306,
                -0.2840155429615469,
                0.0004724845739132828,
                0.12874742662047847,
                -0.017369301001807547,
                -0.044088253930794755,
                0.013981027917398282,
                0.008746094047405777,
                -0.004870352993451574,
                -0.00039174037337694705,
                0.0006754494064505693,
                -0.00011747678412476953,
            ],
            Self::Db9 => &[
                0.038077947363878345,
                0.24383467461259034,
                0.6048231236901112,
                0.6572880780513005,
                0.13319738582500756,
                -0.2932737832791749,
                -0.09684078322297646,
                0.14854074933810638,
                0.03072568147933338,
                -0.06763282906132997,
                0.00025094711483145197,
                0.022361662123679096,
                -0.004723204757751397,
                -0.00428150368246343,
                0.0018476468830562265,
                0.00023038576352319597,
                -0.0002519631889427101,
                3.93473203162716e-05,
            ],
            Self::Db10 => &[
                0.026670057900555554,
                0.1881768000776915,
                0.5272011889317256,
                0.6884590394536035,
                0.2811723436605775,
                -0.24984642432731538,
                -0.19594627437737705,
                0.12736934033579325,
                0.09305736460357235,
                -0.07139414716639708,
                -0.029457536821875813,
                0.033212674059341,
                0.0036065535669561697,
                -0.010733175483330575,
                0.001395351747052901,
                0.001992405295185056,
                -0.0006858566949597116,
                -0.00011646685512928545,
                9.358867032006959e-05,
                -1.3264202894521244e-05,
            ],
            Self::Sym2 => {
                &[0.48296291314469025, 0.836516303737469, 0.22414386804185735, -0.12940952255092145]
            }
            Self::Sym3 => &[
                0.3326705529509569,
                0.8068915093133388,
                0.4598775021193313,
                -0.13501102001039084,
                -0.08544127388224149,
                0.035226291882100656,
            ],
            Self::Sym4 => &[
                0.0322231006040427,
                -0.012603967262037833,
                -0.09921954357684722,
                0.29785779560527736,
                0.8037387518059161,
                0.49761866763201545,
                -0.02963552764599851,
                -0.07576571478927333,
            ],
            Self::Sym5 => &[
                0.019538882735286728,
                -0.021101834024758855,
                -0.17532808990845047,
                0.01660210576452232,
                0.6339789634582119,
                0.7234076904024206,
                0.1993975339773936,
                -0.039134249302383094,
                0.029519490925774643,
                0.027333068345077982,
            ],
            Self::Sym6 => &[
                -0.007800708325034148,
                0.0017677118642428036,
                0.04472490177066578,
                -0.021060292512300564,
                -0.07263752278646252,
                0.3379294217276218,
                0.787641141030194,
                0.4910559419267466,
                -0.048311742585633,
                -0.11799011114819057,
                0.0034907120842174702,
                0.015404109327027373,
            ],
            Self::Sym7 => &[
                0.010268176708511255,
                0.004010244871533663,
                -0.10780823770381774,
                -0.14004724044296152,
                0.2886296317515146,
                0.767764317003164,
                0.5361019170917628,
                0.017441255086855827,
                -0.049552834937127255,
                0.0678926935013727,
                0.03051551316596357,
                -0.01263630340325193,
                -0.0010473848886829163,
                0.002681814568257878,
            ],
            Self::Sym8 => &[
                0.0018899503327594609,
                -0.0003029205147213668,
                -0.01495225833704823,
                0.003808752013890615,
                0.049137179673607506,
                -0.027219029917056003,
                -0.05194583810770904,
                0.3644418948353314,
                0.7771857517005235,
                0.4813596512583722,
                -0.061273359067658524,
                -0.1432942383508097,
                0.007607487324917605,
                0.03169508781149298,
                -0.0005421323317911481,
                -0.0033824159510061256,
            ],
            Self::Sym9 => &[
                0.0010694900329086053,
                -0.0004731544986800831,
                -0.010264064027633142,
                0.008859267493400484,
                0.06207778930288603,
                -0.018233770779395985,
                -0.19155083129728512,
                0.035272488035271894,
                0.6173384491409358,
                0.717897082764412,
                0.238760914607303,
                -0.05456895843083407,
                0.0005834627461258068,
                0.03022487885827568,
                -0.01152821020767923,
                -0.013271967781817119,
                0.0006197808889855868,
                0.0014009155259146807,
            ],
            Self::Sym10 => &[
                -0.0004593294210046588,
                5.7036083618494284e-05,
                0.004593173585311828,
                -0.0008043589320165449,
                -0.02035493981231129,
                0.005764912033581909,
                0.04999497207737669,
                -0.0319900568824278,
                -0.03553674047381755,
                0.38382676106708546,
                0.7695100370211071,
                0.47169066693843925,
                -0.07088053578324385,
                -0.15949427888491757,
                0.011609893903711381,
                0.0459272392310922,
                -0.0014653825813050513,
                -0.008641299277022422,
                9.563267072289475e-05,
                0.0007701598091144901,
            ],
        }
    }

    /// Returns the high-pass filter of the synthesis, `g[k] = (-1)^k h[F - 1 - k]`.
    #[must_use]
    pub fn high_pass(self) -> Vec<f64> {
        let low = self.low_pass();
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        low.iter().rev().enumerate().map(|(k, h)| sign(k) * h).collect()
    }

    /// Returns the largest number of spans of the coarsest level, on either side of a sample, whose nodes the sample depends on.
    #[must_use]
    pub fn reach(self) -> usize {
        self.low_pass().len() / 4 * 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Wavelet::*;

    const ALL: [Wavelet; 19] = [
        Haar, Db2, Db3, Db4, Db5, Db6, Db7, Db8, Db9, Db10, Sym2, Sym3, Sym4, Sym5, Sym6, Sym7, Sym8, Sym9,
        Sym10,
    ];

    #[test]
    fn filters_are_orthogonal_at_even_shifts() {
        for wavelet in ALL {
            let (low, high) = (wavelet.low_pass(), wavelet.high_pass());
            let sum: f64 = low.iter().sum();
            assert!((sum - std::f64::consts::SQRT_2).abs() < 1e-9, "{wavelet:?}: {sum}");
            for shift in (0..low.len()).step_by(2) {
                let dot =
                    |a: &[f64], b: &[f64]| -> f64 { a[shift..].iter().zip(b).map(|(a, b)| a * b).sum() };
                let own = if shift == 0 { 1.0 } else { 0.0 };
                assert!((dot(low, low) - own).abs() < 2e-11, "{wavelet:?} {shift}");
                assert!((dot(&high, &high) - own).abs() < 2e-11, "{wavelet:?} {shift}");
                assert!(
                    dot(low, &high).abs() < 2e-11 && dot(&high, low).abs() < 2e-11,
                    "{wavelet:?} {shift}"
                );
            }
        }
    }
}
