//! The order of points in the leaves of a k-d tree.

/// Children of a node, and points of a leaf.
pub const LANES: usize = 16;

/// Coordinates that a vector register of any processor holds.
pub(super) const QUAD: usize = 4;

/// Minimum number of points that two threads sort.
const SHARED: usize = 4096;

/// Number of children of a node over some points: as many as a tree of this height needs, each with as many points.
pub(super) fn children(points: usize) -> usize {
    let mut most = LANES;
    while most * LANES < points {
        most *= LANES;
    }
    points.div_ceil(most)
}

/// Number of points in the first half of some parts: whole leaves, so that few lanes are empty.
pub(super) fn middle(points: usize, parts: usize) -> usize {
    (points * (parts / 2) / parts).next_multiple_of(LANES).min(points - 1)
}

/// The point of a key.
pub(super) fn point(key: u64) -> usize {
    key as u32 as usize
}

/// A number whose order is that of [`f32::total_cmp`].
fn in_order(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

/// Points while a tree is built over them.
pub(super) struct Points {
    dims: usize,
    /// Number of quads of a point.
    quads: usize,
    /// Coordinates of point after point, each with zeros up to whole quads.
    coordinates: Vec<[f32; QUAD]>,
}

impl Points {
    pub(super) fn new(count: usize, dims: usize) -> Self {
        let quads = dims.div_ceil(QUAD);
        Self { dims, quads, coordinates: vec![[0.0; QUAD]; count * quads] }
    }

    pub(super) fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f32]> {
        let dims = self.dims;
        self.coordinates
            .chunks_exact_mut(self.quads.max(1))
            .map(move |quads| &mut quads.as_flattened_mut()[..dims])
    }

    pub(super) fn row(&self, point: usize) -> &[f32] {
        &self.coordinates[point * self.quads..][..self.quads].as_flattened()[..self.dims]
    }

    /// The ends of the box around some points, for the axes of quad `k`.
    pub(super) fn ends(&self, keys: &[u64], k: usize) -> [[f32; QUAD]; 2] {
        let (mut low, mut high) = ([f32::INFINITY; QUAD], [f32::NEG_INFINITY; QUAD]);
        for key in keys {
            let quad = &self.coordinates[point(*key) * self.quads + k];
            low.iter_mut().zip(quad).for_each(|(low, x)| *low = if *x < *low { *x } else { *low });
            high.iter_mut().zip(quad).for_each(|(high, x)| *high = if *x > *high { *x } else { *high });
        }
        [low, high]
    }

    /// Largest magnitude of a coordinate of some points.
    pub(super) fn extent(&self, keys: &[u64]) -> f64 {
        let ends = (0..self.quads).flat_map(|k| {
            let [low, high] = self.ends(keys, k);
            low.into_iter().zip(high)
        });
        // Not those of an axis without numbers.
        let magnitudes = ends.filter(|(low, high)| low <= high).map(|(low, high)| f64::from(high.max(-low)));
        magnitudes.fold(0.0, f64::max)
    }

    /// The axis along which some points spread most; of equals the last.
    fn widest(&self, keys: &[u64]) -> usize {
        let widths = (0..self.quads).flat_map(|k| {
            let [low, high] = self.ends(keys, k);
            std::array::from_fn::<f32, QUAD, _>(|k| high[k] - low[k])
        });
        let widest = widths.take(self.dims).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        widest.map_or(0, |(axis, _)| axis)
    }

    /// Puts the keys of points in the order of the leaves, on all cores: each of `parts` parts in turn lies in a box of its own, and is ordered
    /// in the same way as a node. The lower half of a key is the number of a point.
    pub(super) fn arrange(&self, keys: &mut [u64], parts: usize) {
        if parts <= 1 {
            if keys.len() > LANES {
                self.arrange(keys, children(keys.len()));
            }
            return;
        }
        let axis = self.widest(keys);
        // Of equal coordinates the first point is first.
        for key in &mut *keys {
            let x = self.coordinates[point(*key) * self.quads + axis / QUAD][axis % QUAD];
            *key = u64::from(in_order(x)) << 32 | u64::from(*key as u32);
        }
        let (count, middle) = (keys.len(), middle(keys.len(), parts));
        keys.select_nth_unstable(middle);
        let (low, high) = keys.split_at_mut(middle);
        let mut low = || self.arrange(low, parts / 2);
        let mut high = || self.arrange(high, parts - parts / 2);
        if count < SHARED {
            low();
            high();
        } else {
            rayon::join(low, high);
        }
    }
}
