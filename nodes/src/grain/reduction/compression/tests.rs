use super::super::testing::stored;
use super::*;
use crate::core::random::Random;

fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Number(x) => Some(*x),
        _ => None,
    }
}

#[test]
fn fewer_bytes_have_greater_errors_and_a_budget_is_spent_better_than_at_random() {
    let (recordings, dictionary, patterns) = stored(4);
    let rules = CompressionRules {
        bits: vec![10, 6],
        merge: vec![1.0, 0.95, 0.8],
        shares: vec![0.5],
        random_sets: 8,
        neighbours: 32,
        margin: 220,
    };
    let (coded, stored) = (Some((&recordings, 1000)), (&dictionary, &patterns));
    let of = |random| compression_table(&recordings, coded, stored, &rules, random, &|_| false).unwrap();
    let table = of(Random::new(3, "table"));
    let rows = |method: &str| -> Vec<Vec<Option<f64>>> {
        let of_method = table.rows.iter().filter(|row| row[0] == Cell::from(method));
        of_method.map(|row| row.iter().map(number).collect()).collect()
    };
    let at = |row: &[Option<f64>], k: usize| row[k].unwrap();
    let all = rows("all grains")[0].clone();
    // 16 bits for each grain, without grains 50 dB below the loudest.
    assert!(at(&all, 6) > 30.0 && at(&all, 7) < 2.0, "{all:?}");
    // The same recordings are without error.
    assert_eq!(
        rows("other coder")[0][3..8],
        [Some(1000.0), Some(0.0), Some(1000.0 / 160_000.0), Some(35.0), Some(0.0)]
    );
    let coarse = rows("fewer bits");
    assert!(at(&coarse[1], 3) < at(&coarse[0], 3) && at(&coarse[1], 6) > 20.0, "{coarse:?}");
    let merged = rows("merged");
    assert_eq!(at(&merged[0], 3), at(&all, 3));
    for pair in merged.windows(2) {
        assert!(at(&pair[1], 3) <= at(&pair[0], 3) && at(&pair[1], 6) <= at(&pair[0], 6) + 0.1, "{pair:?}");
    }
    let (subset, random) = (rows("subset")[0].clone(), rows("random")[0].clone());
    assert!(at(&subset, 3) <= 0.6 * at(&all, 3));
    assert!(at(&subset, 6) > at(&random, 6) + 2.0 * at(&random, 8), "{subset:?} {random:?}");
    assert_eq!(table.charts.len(), 2);
    assert_eq!(of(Random::new(3, "table")).rows, table.rows);
    assert!(compression_table(&recordings, coded, stored, &rules, Random::new(3, "x"), &|_| true).is_none());
}
