//! Matches that do not overlap.

use super::matches::MotionMatch;

/// Times that differ by less are equal, s.
const EQUAL: f64 = 1e-9;

/// Returns the matches that do not overlap a more similar one, in order of time. Of equal matches the earlier, then the shorter one is chosen.
///
/// # Complexity
/// Quadratic in the worst case.
#[must_use]
pub fn most_similar(mut all: Vec<MotionMatch>) -> Vec<MotionMatch> {
    let mut chosen: Vec<MotionMatch> = Vec::new();
    all.sort_by(|a, b| {
        let length = |m: &MotionMatch| m.to - m.from;
        b.similarity
            .total_cmp(&a.similarity)
            .then(a.from.total_cmp(&b.from))
            .then(length(a).total_cmp(&length(b)))
    });
    for m in all {
        let k = chosen.partition_point(|other| other.from < m.from);
        let is_free = chosen.get(k).is_none_or(|next| next.from >= m.to - EQUAL)
            && k.checked_sub(1).is_none_or(|k| chosen[k].to <= m.from + EQUAL);
        if is_free {
            chosen.insert(k, m);
        }
    }
    chosen
}

/// Returns the matches without overlap that have the greatest sum of similarities, or the `count` most similar of them, in order of time.
///
/// # Complexity
/// `N log N` in the matches.
///
/// # Source
/// Kleinberg and Tardos, "Algorithm Design" (2005), section 6.1: weighted interval scheduling.
#[must_use]
pub fn greatest_sum(mut all: Vec<MotionMatch>, count: Option<usize>) -> Vec<MotionMatch> {
    let mut chosen = Vec::new();
    all.sort_by(|a, b| a.to.total_cmp(&b.to).then(a.from.total_cmp(&b.from)));
    // The best sum of the matches up to each, and the number of those that end before one begins.
    let mut sums = vec![0.0];
    let before: Vec<usize> =
        all.iter().map(|m| all.partition_point(|other| other.to <= m.from + EQUAL)).collect();
    for (k, m) in all.iter().enumerate() {
        let with = m.similarity + sums[before[k]];
        sums.push(with.max(sums[k]));
    }
    let mut k = all.len();
    while k > 0 {
        if sums[k] > sums[k - 1] {
            chosen.push(all[k - 1]);
            k = before[k - 1];
        } else {
            k -= 1;
        }
    }
    if let Some(count) = count {
        chosen.sort_by(|a: &MotionMatch, b| {
            b.similarity.total_cmp(&a.similarity).then(a.from.total_cmp(&b.from))
        });
        chosen.truncate(count);
    }
    chosen.sort_by(|a, b| a.from.total_cmp(&b.from));
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_are_left_out() {
        let m = |from: f64, to: f64, similarity: f64| MotionMatch { from, to, similarity };
        let all =
            vec![m(0.0, 1.0, 0.8), m(0.9, 2.0, 0.9), m(2.0, 3.0, 0.8), m(5.0, 6.0, 0.7), m(5.0, 5.5, 0.7)];
        assert_eq!(most_similar(all.clone()), [all[1], all[2], all[4]]);
        assert_eq!(greatest_sum(all.clone(), None)[..2], [all[1], all[2]]);
        let tight = vec![m(0.0, 1.0, 0.8), m(0.9, 2.0, 0.9), m(1.9, 3.0, 0.8)];
        assert_eq!(most_similar(tight.clone()), [tight[1]]);
        assert_eq!(greatest_sum(tight.clone(), None), [tight[0], tight[2]]);
        assert_eq!(greatest_sum(all.clone(), Some(2)), [all[1], all[2]]);
    }
}
