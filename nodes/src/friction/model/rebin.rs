//! Resampling of a power spectrum to another frequency grid, by integration of the density.

/// Returns the edges of bin `k` of `bins`, in units of the bin spacing.
///
/// DC and Nyquist have half a cell each. Their one-sided density counts once, so over half the width it equals that of
/// their neighbours, and white noise stays white on any grid.
fn cell(k: usize, bins: usize) -> (f64, f64) {
    let centre = k as f64;
    ((centre - 0.5).max(0.0), (centre + 0.5).min((bins - 1) as f64))
}

/// Spreads the power of each source bin evenly over its cell and sums it in the cells of another grid.
///
/// The result is zero above the source's Nyquist frequency. Power above the target's Nyquist frequency is lost.
///
/// # Shapes
/// `power: [n]` bins spaced `df` from 0, `out: [m]` bins spaced `out_df` from 0; power per bin, not density.
///
/// # Complexity
/// O(n + m), no allocation.
pub fn rebin(power: &[f64], df: f64, out: &mut [f64], out_df: f64) {
    out.fill(0.0);
    if power.len() < 2 || out.len() < 2 || !(df > 0.0 && out_df > 0.0) {
        return;
    }
    if power.len() == out.len() && df == out_df {
        out.copy_from_slice(power);
        return;
    }
    let (n, m) = (power.len(), out.len());
    let mut j = 0;
    for (i, &mass) in power.iter().enumerate() {
        let (low, high) = cell(i, n);
        let (low, high) = (low * df, high * df);
        while j < m {
            let (from, to) = cell(j, m);
            let (from, to) = (from * out_df, to * out_df);
            let overlap = high.min(to) - low.max(from);
            if overlap > 0.0 {
                out[j] += mass * overlap / (high - low);
            }
            if to > high {
                break;
            }
            j += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// White noise in power per bin: half as much at DC and Nyquist.
    fn white(bins: usize, df: f64) -> Vec<f64> {
        (0..bins).map(|k| if k == 0 || k == bins - 1 { 0.5 * df } else { df }).collect()
    }

    #[test]
    fn white_noise_stays_white_up_to_the_source_nyquist() {
        let source = white(101, 10.0);
        let mut out = vec![0.0; 401];
        rebin(&source, 10.0, &mut out, 4.0);
        assert!((out[0] - 2.0).abs() < 1e-12);
        assert!(out[1..250].iter().all(|p| (p - 4.0).abs() < 1e-12));
        assert!((out[250] - 2.0).abs() < 1e-9, "the cell with the source's Nyquist frequency is half full");
        assert!(out[251..].iter().all(|&p| p == 0.0));
    }

    proptest! {
        #[test]
        fn power_is_preserved_when_the_target_has_the_same_nyquist_frequency(
            power in prop::collection::vec(0.0..1.0_f64, 2..60),
            df in 0.5..20.0_f64,
            m in 2..200_usize,
        ) {
            let nyquist = df * (power.len() - 1) as f64;
            let mut out = vec![0.0; m];
            rebin(&power, df, &mut out, nyquist * 1.0001 / (m - 1) as f64);
            let (a, b): (f64, f64) = (power.iter().sum(), out.iter().sum());
            prop_assert!((a - b).abs() <= 1e-9 * (1.0 + a), "{} {}", a, b);
            prop_assert!(out.iter().all(|&p| p >= 0.0));
        }
    }
}
