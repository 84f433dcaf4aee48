//! Statistics of a listening test, as a node.

use super::ratings::{read_ratings, test_ratings};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Func, Summary};
use crate::core::params::AssetPath;
use crate::core::ports::Value;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::plot::{Chart, Line};
use crate::statistics::mean_and_deviation;
use crate::table::{Cell, ResultTable};
use crate::{params, ports};
use std::fmt::Write as _;

/// Level of a significant difference.
const SIGNIFICANT: f64 = 0.05;

params! {
    /// Tests by the ratings of a listening test if sounds of one material are more alike than those of different ones.
    ///
    /// The file is a CSV with the columns `set` (name of a set of materials), `pair` (`same` or `different` material) and `rating` (1 to 11);
    /// other columns have no effect. Each set has a row with means, standard deviations, Welch's t test and Cohen's d. The summary has
    /// the one-way analysis of variance of the ratings of same materials over the sets.
    ///
    /// # Source
    /// Sterling et al., "Audio-material reconstruction for virtualized reality using a probabilistic damping model" (IEEE TVCG 25(5),
    /// 2019), section 6.2 and table 2.
    pub struct RatingStatisticsParams {
        /// The ratings.
        path: AssetPath;
    }
}
ports! {
    pub struct RatingStatisticsPorts / RatingStatisticsIo {
        in {}
        out {
            /// A row for each set.
            table: Value<ResultTable>,
        }
    }
}

/// The node over [`test_ratings`].
#[derive(Debug)]
pub struct RatingStatistics;

fn refused(path: &AssetPath, problem: &str) -> Reject {
    Reject::new("F138", format!("{:?}: {problem}", path.0)).at("path")
}

impl Func for RatingStatistics {
    type Params = RatingStatisticsParams;
    type Ports = RatingStatisticsPorts;
    const NAME: &'static str = "RatingStatistics";

    fn check(p: &RatingStatisticsParams, s: &mut Shape<'_, '_, RatingStatisticsPorts>) -> Result<(), Reject> {
        read_ratings(&s.bytes("path", &p.path.0)?).map(drop).map_err(|e| refused(&p.path, &e))
    }

    fn eval(
        p: &RatingStatisticsParams,
        cx: &Build<'_>,
        mut io: RatingStatisticsIo<'_>,
    ) -> Result<Summary, Fault> {
        let sets = read_ratings(&cx.bytes("path", &p.path.0)?).map_err(|e| refused(&p.path, &e))?;
        let report = test_ratings(&sets);
        let mut table = ResultTable::new(&[
            "set",
            "same_n",
            "same_mean",
            "same_sd",
            "different_n",
            "different_mean",
            "different_sd",
            "welch_t",
            "freedom",
            "p",
            "cohen_d",
        ]);
        let mut means = [Vec::new(), Vec::new()];
        let mut significant = 0;
        for (k, (set, test)) in sets.iter().zip(&report.tests).enumerate() {
            let mut row: Vec<Cell> = vec![set.name.as_str().into()];
            for (ratings, means) in [&set.same, &set.different].into_iter().zip(&mut means) {
                let [mean, deviation] = mean_and_deviation(ratings);
                row.extend([ratings.len().into(), mean.into(), deviation.into()]);
                means.extend(mean.map(|mean| [k as f64 + 1.0, mean]));
            }
            row.extend([
                test.map(|t| t.t).into(),
                test.map(|t| t.freedom).into(),
                test.map(|t| t.p).into(),
                test.map(|t| t.d).into(),
            ]);
            significant += usize::from(test.is_some_and(|t| t.p < SIGNIFICANT));
            table.push(row);
        }
        let names: Vec<&str> = sets.iter().map(|s| s.name.as_str()).collect();
        let [same, different] = means;
        let lines = vec![Line::dots("same", same), Line::dots("different", different)];
        let mut label = String::from("set");
        let _ = names.iter().enumerate().try_for_each(|(k, name)| write!(label, ", {} {name}", k + 1));
        table.charts = vec![Chart::of("Mean ratings", (&label, false), ("rating", false), lines)];
        io.table.set(table);
        let mut summary = vec![
            ("ratings", sets.iter().map(|s| s.same.len() + s.different.len()).sum::<usize>().into()),
            ("sets", sets.len().into()),
            ("significant_at_0.05", significant.into()),
        ];
        if let Some(analysis) = report.between_sets {
            summary.push(("anova_f", analysis.f.into()));
            summary.push(("anova_freedom", serde_json::json!(analysis.freedom)));
            summary.push(("anova_p", analysis.p.into()));
        }
        Ok(summary)
    }

    fn trial(rng: &mut Rng) -> (RatingStatisticsParams, MemoryFiles) {
        let mut csv = String::from("set,pair,rating\n");
        for _ in 0..20 + rng.below(20) {
            let (set, pair) = (["a", "b"][rng.below(2)], ["same", "different"][rng.below(2)]);
            // Writing to a string cannot fail.
            let _ = writeln!(csv, "{set},{pair},{}", 1 + rng.below(11));
        }
        let mut files = MemoryFiles::default();
        files.insert("ratings.csv", csv.into_bytes());
        (RatingStatisticsParams { path: "ratings.csv".into() }, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::{Datum, Params};
    use crate::core::standalone::Standalone;

    fn shipped() -> Vec<u8> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/assets/material/synthetic_ratings.csv");
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_statistics_of_the_shipped_ratings_are_those_of_scipy() {
        let sets = read_ratings(&shipped()).unwrap();
        let report = test_ratings(&sets);
        // nodes/tests/oracles/ratings.py: ttest_ind(equal_var=False) and f_oneway.
        let expected = SCIPY;
        for (test, (t, freedom, p, d)) in report.tests.iter().map(|t| t.unwrap()).zip(expected) {
            for (found, exact) in [(test.t, t), (test.freedom, freedom), (test.p, p), (test.d, d)] {
                assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
            }
        }
        let analysis = report.between_sets.unwrap();
        assert!((analysis.f / ANOVA.0 - 1.0).abs() < 1e-9 && (analysis.p / ANOVA.1 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_table_has_a_row_for_each_set() {
        let find = |name: &str| (name == "path").then(|| Datum::Text("r.csv".into()));
        let mut standalone =
            Standalone::func::<RatingStatistics>(RatingStatisticsParams::read(&find).unwrap());
        standalone.files.insert("r.csv", shipped());
        let run = standalone.run().unwrap();
        let table = run.value(0).unwrap().get::<ResultTable>().unwrap().clone();
        assert!(table.rows.len() == 3 && table.csv().contains("\nHybrid,"), "{}", table.csv());
    }

    #[test]
    fn wrong_files_are_named() {
        for (text, part) in [
            ("set,pair\na,same\n", "no column `rating`"),
            ("set,pair,rating\na,same,12\n", "line 2: `rating` is \"12\"; a number from 1 to 11"),
            ("set,pair,rating\na,equal,1\n", "`same` or `different`"),
            ("set,pair,rating\n,same,1\n", "a name is needed"),
            ("set,pair,rating\n", "no ratings"),
        ] {
            let e = read_ratings(text.as_bytes()).unwrap_err();
            assert!(e.contains(part), "{text:?}: {e}");
        }
    }

    /// t, degrees of freedom, p and Cohen's d of each set.
    const SCIPY: [(f64, f64, f64, f64); 3] = [
        (2.475_827_648_865_638, 66.147_495_034_084_02, 0.015_860_223_854_996_622, 0.511_523_181_233_365_4),
        (1.694_138_337_382_522_5, 72.442_155_328_155_64, 0.094_534_548_948_174_7, 0.337_620_549_196_234_9),
        (5.055_136_148_094_126, 58.561_241_688_150_16, 4.518_314_642_519_506e-6, 1.100_243_311_521_276_9),
    ];
    /// F and p.
    const ANOVA: (f64, f64) = (0.375_257_731_958_762_9, 0.687_936_130_749_152_8);
}
