//! The best of all paths, with units that recur too early replaced.

use super::path::{GlobalParams, Path};
use super::programme::Programme;
use super::repair::{Repair, repair};
use super::table::Table;
use crate::unit::selection::selector::NotFinite;

/// The best path through the units of a database for a whole target.
///
/// V_i(j) = min(D1(i, j), cap) + min(V_{i-1}(j - 1) where j - 1 precedes j in its recording, min V_{i-1} + p): a jump costs the same
/// from everywhere, so that one minimum per row represents all of them. Of equal paths, one without a jump is taken.
///
/// # Shapes
/// `target`: `[n * dims]`. `block`: rows between checkpoints, which changes nothing but memory and time; `None` for about sqrt n, and none where all
/// decisions fit into 64 MiB.
///
/// # Errors
/// A feature of the target that is not finite.
///
/// # Precision
/// Rows are stored in single precision relative to the least cost of the row before, so that no number in them exceeds one price and one
/// distance, and the error does not grow with the length of the take: the path costs at most 2^-22 (p + greatest distance) per
/// target more than the best. Its cost is summed in double precision along the path.
///
/// # Complexity
/// For each target the time of a search for the units within the least cost of a row, about the mean distance of units that are chosen, and of the
/// units whose cost exceeds the least by less than a jump: some hundreds of ten thousands where a jump costs as much as such a distance. Once if
/// the decisions of all rows, `n m / 8` bytes, take at most 64 MiB, and else twice; again for parts of the target that are repaired. At most O(n m dims).
/// 8 bytes for each of those units at the ends of blocks of 32 targets or more, at most `4 m sqrt n`, and these decisions, or `4 m` bytes per thread
/// for those of a block.
///
/// # Source
/// Viterbi (1967) for the programme, over states that can still be part of the best path; Hirschberg (1975) and Grice, Hughey and Speck, "Reduced space sequence alignment" (1997) for the
/// checkpoints.
pub fn exact(
    table: &Table,
    target: &[f32],
    params: &GlobalParams,
    block: Option<usize>,
) -> Result<Path, NotFinite> {
    table.check(target)?;
    if target.len() < table.dims() {
        return Ok(Path::default());
    }
    let mut programme = Programme::new(table, target, params, block);
    let all = vec![true; programme.blocks()];
    programme.solve(&all);
    let free_cost = table.cost(target, &programme.path, params);
    let repaired = repair(&mut programme, params);
    let cost = table.cost(target, &programme.path, params);
    let units = table.named(&programme.path);
    let Repair { repeats, rounds, replaced } = repaired;
    Ok(Path { units, cost, free_cost, repeats, rounds, replaced })
}
