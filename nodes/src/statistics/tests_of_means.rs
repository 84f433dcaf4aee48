//! Tests of ratings: Welch's t, Cohen's d and analysis of variance.

use super::special::{f_above, t_two_sided};
use serde::{Deserialize, Serialize};

/// Mean and unbiased variance; `None` for fewer than two values.
fn moments(x: &[f64]) -> Option<[f64; 2]> {
    if x.len() < 2 {
        return None;
    }
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let square = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    Some([mean, square / (x.len() - 1) as f64])
}

/// A comparison of two groups of unequal variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WelchTest {
    /// Statistic.
    pub t: f64,
    /// Degrees of freedom after Satterthwaite.
    pub freedom: f64,
    /// Two-sided p value.
    pub p: f64,
    /// Cohen's d, over the pooled standard deviation.
    pub d: f64,
}

/// Welch's t test with Cohen's d; `None` for groups of fewer than two values or without variance.
///
/// # Source
/// Welch, "The generalization of Student's problem when several different population variances are involved" (Biometrika 34,
/// 1947); Cohen, "Statistical Power Analysis for the Behavioral Sciences" (1988).
#[must_use]
pub fn welch(a: &[f64], b: &[f64]) -> Option<WelchTest> {
    let ([ma, va], [mb, vb]) = (moments(a)?, moments(b)?);
    let (na, nb) = (a.len() as f64, b.len() as f64);
    let (sa, sb) = (va / na, vb / nb);
    let t = (ma - mb) / (sa + sb).sqrt();
    let freedom = (sa + sb).powi(2) / (sa * sa / (na - 1.0) + sb * sb / (nb - 1.0));
    let pooled = (((na - 1.0) * va + (nb - 1.0) * vb) / (na + nb - 2.0)).sqrt();
    let test = WelchTest { t, freedom, p: t_two_sided(t, freedom), d: (ma - mb) / pooled };
    (test.t.is_finite() && test.freedom.is_finite()).then_some(test)
}

/// An analysis of variance of several groups.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VarianceAnalysis {
    /// Variance ratio.
    pub f: f64,
    /// Degrees of freedom between groups and within them.
    pub freedom: [f64; 2],
    /// p value.
    pub p: f64,
}

/// One-way analysis of variance; `None` for fewer than two groups, empty groups, or no variance within them.
#[must_use]
pub fn anova(groups: &[&[f64]]) -> Option<VarianceAnalysis> {
    let count: usize = groups.iter().map(|g| g.len()).sum();
    if groups.len() < 2 || groups.iter().any(|g| g.is_empty()) || count <= groups.len() {
        return None;
    }
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let grand = groups.iter().flat_map(|g| g.iter()).sum::<f64>() / count as f64;
    let between: f64 = groups.iter().map(|g| g.len() as f64 * (mean(g) - grand).powi(2)).sum();
    let within: f64 = groups.iter().map(|g| g.iter().map(|x| (x - mean(g)).powi(2)).sum::<f64>()).sum();
    let freedom = [(groups.len() - 1) as f64, (count - groups.len()) as f64];
    let f = between / freedom[0] / (within / freedom[1]);
    f.is_finite().then(|| VarianceAnalysis { f, freedom, p: f_above(f, freedom[0], freedom[1]) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_those_of_scipy() {
        // ttest_ind(equal_var=False) and f_oneway.
        let (a, b) = ([6.8, 5.1, 7.2, 6.0, 8.1, 4.4, 6.6], [5.1, 4.0, 6.3, 5.5, 3.8]);
        let test = welch(&a, &b).unwrap();
        for (found, exact) in [
            (test.t, 2.059_052_576_992_722_4),
            (test.freedom, 9.668_470_331_462_206),
            (test.p, 0.067_446_354_488_422_69),
            (test.d, 1.165_629_969_814_653_3),
        ] {
            assert!((found - exact).abs() < 1e-12, "{found} {exact}");
        }
        let analysis = anova(&[&a, &b, &[7.0, 6.5, 5.9, 6.1]]).unwrap();
        assert!((analysis.f - 2.986_536_308_205_347_5).abs() < 1e-12, "{analysis:?}");
        assert!((analysis.p - 0.085_651_888_322_183_23).abs() < 1e-12, "{analysis:?}");
        assert_eq!(analysis.freedom, [2.0, 13.0]);
    }

    #[test]
    fn groups_that_cannot_be_compared_give_none() {
        assert!(welch(&[1.0], &[1.0, 2.0]).is_none() && welch(&[1.0; 3], &[1.0; 3]).is_none());
        assert!(anova(&[&[1.0, 2.0]]).is_none() && anova(&[&[1.0], &[2.0]]).is_none());
        assert!(anova(&[&[1.0, 2.0], &[]]).is_none() && anova(&[&[1.0, 1.0], &[2.0, 2.0]]).is_none());
    }
}
