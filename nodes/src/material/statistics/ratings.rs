//! Ratings of a listening test, and the statistics of the paper's table 2.

use crate::core::files::strip_bom;
use crate::statistics::tests_of_means::{VarianceAnalysis, WelchTest, anova, welch};

/// Maximum number of ratings.
pub const MAX_RATINGS: usize = 1 << 20;

/// Ratings of one set of materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RatedSet {
    /// Name of the set, such as `Rayleigh`.
    pub name: String,
    /// Ratings of pairs of one material.
    pub same: Vec<f64>,
    /// Ratings of pairs of different materials.
    pub different: Vec<f64>,
}

/// Statistics of ratings.
#[derive(Clone, Debug, PartialEq)]
pub struct RatingReport {
    /// Welch's test of each set: same materials against different ones; `None` where it does not exist.
    pub tests: Vec<Option<WelchTest>>,
    /// Analysis of variance of the ratings of same materials over the sets.
    pub between_sets: Option<VarianceAnalysis>,
}

/// Tests ratings.
///
/// # Complexity
/// O(n).
///
/// # Source
/// Sterling et al. (IEEE TVCG 25(5), 2019), section 6.2 and table 2.
#[must_use]
pub fn test_ratings(sets: &[RatedSet]) -> RatingReport {
    let same: Vec<&[f64]> = sets.iter().map(|s| s.same.as_slice()).collect();
    RatingReport {
        tests: sets.iter().map(|s| welch(&s.same, &s.different)).collect(),
        between_sets: anova(&same),
    }
}

/// Reads ratings from a CSV: `set` (a name), `pair` (`same` or `different`) and `rating` (1 to 11), in any order, with other columns
/// between; a row that repeats the header has no effect.
///
/// # Errors
/// A message with the line, the value found, and what is needed.
///
/// # Example
/// ```
/// let csv = "subject,set,pair,rating\n1,Rayleigh,same,8\n1,Rayleigh,different,3\n";
/// let sets = foley_nodes::material::statistics::ratings::read_ratings(csv.as_bytes())?;
/// assert_eq!((sets[0].same[0], sets[0].different[0]), (8.0, 3.0));
/// # Ok::<(), String>(())
/// ```
pub fn read_ratings(bytes: &[u8]) -> Result<Vec<RatedSet>, String> {
    let reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(strip_bom(bytes));
    let mut reader = reader;
    let header: Vec<String> =
        reader.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
    let column = |name: &str| {
        let missing = || format!("no column `{name}`; `set`, `pair` and `rating` are needed");
        header.iter().position(|c| c == name).ok_or_else(missing)
    };
    let (set, pair, rating) = (column("set")?, column("pair")?, column("rating")?);
    let mut out: Vec<RatedSet> = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let record = record.map_err(|e| e.to_string())?;
        // Files of several subjects, joined, repeat the header.
        if record.iter().eq(header.iter().map(String::as_str)) {
            continue;
        }
        let line = record.position().map_or(0, csv::Position::line);
        let text = |k: usize| record.get(k).unwrap_or_default();
        let wrong = |column: &str, found: &str, needed: &str| {
            let found: String = found.chars().take(40).collect();
            format!("line {line}: `{column}` is {found:?}; {needed}")
        };
        if k >= MAX_RATINGS {
            return Err(format!("line {line}: at most {MAX_RATINGS} ratings are read"));
        }
        let value = text(rating).parse::<f64>().ok().filter(|x| (1.0..=11.0).contains(x));
        let value = value.ok_or_else(|| wrong("rating", text(rating), "a number from 1 to 11 is needed"))?;
        if text(set).is_empty() {
            return Err(wrong("set", "", "a name is needed"));
        }
        let index = out.iter().position(|s| s.name == text(set)).unwrap_or_else(|| {
            out.push(RatedSet { name: text(set).chars().take(200).collect(), ..RatedSet::default() });
            out.len() - 1
        });
        match text(pair) {
            "same" => out[index].same.push(value),
            "different" => out[index].different.push(value),
            other => return Err(wrong("pair", other, "`same` or `different` is needed")),
        }
    }
    if out.is_empty() {
        return Err("there are no ratings".into());
    }
    Ok(out)
}
