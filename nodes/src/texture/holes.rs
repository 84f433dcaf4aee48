//! Holes in an image: pixels that are not there, and that count for nothing.
//!
//! Holes are a list as long as the image, or an empty one where there is none.

use super::grid::Grid;

/// Whether pixel `k` is a hole.
#[must_use]
pub fn is_hole(holes: &[bool], k: usize) -> bool {
    holes.get(k) == Some(&true)
}

/// The values of all pixels that are there.
pub fn solid<'a>(grid: &'a Grid, holes: &'a [bool]) -> impl Iterator<Item = f32> + Clone + 'a {
    grid.samples.iter().enumerate().filter(|(k, _)| !is_hole(holes, *k)).map(|(_, x)| *x)
}

/// The stretches of one row between holes, in order.
pub fn stretches<'a>(grid: &'a Grid, holes: &[bool], y: usize) -> Vec<&'a [f32]> {
    let row = y * grid.width..(y + 1) * grid.width;
    let Some(samples) = grid.samples.get(row.clone()).filter(|row| !row.is_empty()) else {
        return Vec::new();
    };
    let Some(holes) = holes.get(row) else { return vec![samples] };
    let mut at = 0;
    let parts = holes.chunk_by(|a, b| a == b).filter_map(|same| {
        let from = at;
        at += same.len();
        samples.get(from..at).filter(|_| same.first() == Some(&false))
    });
    parts.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_lie_between_holes() {
        let grid = Grid::from_fn(6, 2, |x, y| (6 * y + x) as f32);
        let holes = [true, false, false, true, false, true].repeat(2);
        assert_eq!(stretches(&grid, &holes, 0), [&[1.0, 2.0][..], &[4.0]]);
        assert_eq!(stretches(&grid, &[], 1), [[6.0, 7.0, 8.0, 9.0, 10.0, 11.0]]);
        assert!(stretches(&grid, &[true; 12], 1).is_empty() && stretches(&grid, &[], 2).is_empty());
        assert_eq!(solid(&grid, &holes).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 7.0, 8.0, 10.0]);
    }
}
