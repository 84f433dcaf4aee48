//! Holes in an image: transparent pixels, which take no part in any computation.
//!
//! Holes are a list as long as the image, or an empty list if there are none.

use super::grid::Grid;

/// Returns true if pixel `k` is a hole.
#[must_use]
pub fn is_hole(holes: &[bool], k: usize) -> bool {
    holes.get(k) == Some(&true)
}

/// Values of all pixels outside holes.
pub fn valid_samples<'a>(grid: &'a Grid, holes: &'a [bool]) -> impl Iterator<Item = f32> + Clone + 'a {
    grid.samples.iter().enumerate().filter(|(k, _)| !is_hole(holes, *k)).map(|(_, x)| *x)
}

/// Segments of one row between holes, in order.
pub fn row_segments<'a>(grid: &'a Grid, holes: &[bool], y: usize) -> Vec<&'a [f32]> {
    let row = y * grid.width..(y + 1) * grid.width;
    let Some(samples) = grid.samples.get(row.clone()).filter(|row| !row.is_empty()) else {
        return Vec::new();
    };
    let Some(holes) = holes.get(row) else { return vec![samples] };
    let mut end = 0;
    let segments = holes.chunk_by(|a, b| a == b).filter_map(|run| {
        let start = end;
        end += run.len();
        samples.get(start..end).filter(|_| run.first() == Some(&false))
    });
    segments.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_lie_between_holes() {
        let grid = Grid::from_fn(6, 2, |x, y| (6 * y + x) as f32);
        let holes = [true, false, false, true, false, true].repeat(2);
        assert_eq!(row_segments(&grid, &holes, 0), [&[1.0, 2.0][..], &[4.0]]);
        assert_eq!(row_segments(&grid, &[], 1), [[6.0, 7.0, 8.0, 9.0, 10.0, 11.0]]);
        assert!(row_segments(&grid, &[true; 12], 1).is_empty() && row_segments(&grid, &[], 2).is_empty());
        assert_eq!(valid_samples(&grid, &holes).collect::<Vec<_>>(), [1.0, 2.0, 4.0, 7.0, 8.0, 10.0]);
    }
}
