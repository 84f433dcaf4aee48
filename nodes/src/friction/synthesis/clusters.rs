//! Clusters of emitters by position: a hash grid with a maximum number of groups.

/// One occupied cell of the grid.
#[derive(Clone, Copy, Default)]
struct Cell {
    /// Sum of positions times power.
    moment: [f64; 3],
    power: f64,
    group: u32,
}

impl Cell {
    /// Returns the power-weighted mean position.
    fn centre(&self) -> [f64; 3] {
        self.moment.map(|m| m / self.power)
    }
}

/// A slot of the hash table.
#[derive(Clone, Copy, Default)]
struct Slot {
    key: [i32; 3],
    /// Clip that filled this slot. Older slots count as empty, so the table is not cleared between clips.
    stamp: u64,
    cell: u32,
}

/// Groups emitters by grid cell, up to a maximum number of groups.
///
/// Above the maximum, the most powerful cells are groups and each other cell joins the nearest of them. Buffers are
/// allocated once for the maximum number of emitters.
pub(crate) struct Clusters {
    size: f32,
    max_groups: usize,
    slots: Vec<Slot>,
    stamp: u64,
    cells: Vec<Cell>,
    of_emitter: Vec<u32>,
    order: Vec<u32>,
}

impl Clusters {
    /// Buffers for at most `emitters` emitters in cells of `size` metres and at most `max_groups` groups.
    pub(crate) fn new(size: f32, max_groups: usize, emitters: usize) -> Self {
        Self {
            size,
            max_groups: max_groups.max(1),
            slots: vec![Slot::default(); (2 * emitters).next_power_of_two().max(2)],
            stamp: 0,
            cells: Vec::with_capacity(emitters),
            of_emitter: Vec::with_capacity(emitters),
            order: Vec::with_capacity(emitters),
        }
    }

    /// Groups emitters by position and power and returns the number of groups, for [`group`](Self::group) and
    /// [`centre`](Self::centre).
    pub(crate) fn assign(&mut self, emitters: impl Iterator<Item = ([f32; 3], f64)>) -> usize {
        self.stamp += 1;
        self.cells.clear();
        self.of_emitter.clear();
        for (position, power) in emitters {
            // With the smallest positive power the centre of silent cells is defined.
            let power = power.max(f64::MIN_POSITIVE);
            let cell = self.cell_at(position.map(|x| (x / self.size).floor() as i32));
            let c = &mut self.cells[cell as usize];
            c.power += power;
            c.moment.iter_mut().zip(position).for_each(|(m, x)| *m += power * f64::from(x));
            self.of_emitter.push(cell);
        }
        self.merge()
    }

    /// Returns the cell with grid coordinates `key`, created if it is empty.
    fn cell_at(&mut self, key: [i32; 3]) -> u32 {
        let mask = self.slots.len() - 1;
        let mixed = key
            .iter()
            .zip([0x9E37_79B9_7F4A_7C15_u64, 0xC2B2_AE3D_27D4_EB4F, 0x1656_67B1_9E37_79F9])
            .fold(0, |h: u64, (&k, m)| (h ^ u64::from(k as u32)).wrapping_mul(m).rotate_left(29));
        let mut i = mixed as usize & mask;
        loop {
            let slot = &mut self.slots[i];
            if slot.stamp != self.stamp {
                *slot = Slot { key, stamp: self.stamp, cell: self.cells.len() as u32 };
                self.cells.push(Cell::default());
                return slot.cell;
            }
            if slot.key == key {
                return slot.cell;
            }
            i = (i + 1) & mask;
        }
    }

    /// Assigns cells to groups and returns the number of groups.
    fn merge(&mut self) -> usize {
        let (count, cells) = (self.cells.len(), &mut self.cells);
        self.order.clear();
        self.order.extend(0..count as u32);
        if count > self.max_groups {
            // Of equal powers the earlier emitter is first, so that the result is a function of the input alone.
            self.order.sort_unstable_by(|&a, &b| {
                cells[b as usize].power.total_cmp(&cells[a as usize].power).then(a.cmp(&b))
            });
        }
        let groups = count.min(self.max_groups);
        for (group, &c) in self.order[..groups].iter().enumerate() {
            cells[c as usize].group = group as u32;
        }
        let (strongest, others) = self.order.split_at(groups);
        for &c in others {
            let centre = cells[c as usize].centre();
            let distance = |k: u32| {
                let other = cells[k as usize].centre();
                (0..3).map(|i| (other[i] - centre[i]).powi(2)).sum::<f64>()
            };
            let nearest =
                (0..groups).min_by(|&i, &j| distance(strongest[i]).total_cmp(&distance(strongest[j])));
            cells[c as usize].group = nearest.unwrap_or(0) as u32;
        }
        // Centres move after all cells are assigned.
        for &c in others {
            let Cell { moment, power, group } = cells[c as usize];
            let target = &mut cells[strongest[group as usize] as usize];
            target.power += power;
            target.moment.iter_mut().zip(moment).for_each(|(m, x)| *m += x);
        }
        groups
    }

    /// Returns the group of the `i`-th emitter of the last [`assign`](Self::assign).
    pub(crate) fn group(&self, i: usize) -> usize {
        self.cells[self.of_emitter[i] as usize].group as usize
    }

    /// Returns the power-weighted mean position of a group.
    pub(crate) fn centre(&self, group: usize) -> [f32; 3] {
        self.cells[self.order[group] as usize].centre().map(|x| x as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emitters_of_one_cell_share_a_group_and_its_weighted_centre() {
        let mut clusters = Clusters::new(0.1, 64, 8);
        let at = [([0.01, 0.0, 0.0], 1.0), ([0.05, 0.0, 0.0], 3.0), ([-0.01, 0.0, 0.0], 1.0)];
        assert_eq!(clusters.assign(at.into_iter()), 2);
        assert_eq!([0, 1, 2].map(|i| clusters.group(i)), [0, 0, 1]);
        assert!((clusters.centre(0)[0] - 0.04).abs() < 1e-6);
        assert!((clusters.centre(1)[0] + 0.01).abs() < 1e-6);
    }

    #[test]
    fn above_the_maximum_weak_cells_join_the_nearest_strong_one() {
        let mut clusters = Clusters::new(0.1, 2, 8);
        let at = [([0.0; 3], 1.0), ([5.0; 3], 10.0), ([0.5, 0.0, 0.0], 8.0), ([4.0; 3], 2.0)];
        assert_eq!(clusters.assign(at.into_iter()), 2);
        assert_eq!([0, 1, 2, 3].map(|i| clusters.group(i)), [1, 0, 1, 0]);
        assert!((clusters.centre(0)[0] - (50.0 + 8.0) / 12.0).abs() < 1e-5);
    }

    #[test]
    fn clips_are_independent_of_earlier_ones() {
        let mut clusters = Clusters::new(0.1, 64, 4);
        clusters.assign([([0.0; 3], 1.0), ([1.0; 3], 1.0)].into_iter());
        assert_eq!(clusters.assign([([1.0; 3], 1.0)].into_iter()), 1);
        assert!((clusters.centre(0)[1] - 1.0).abs() < 1e-6);
        assert_eq!(clusters.assign(std::iter::empty()), 0);
    }

    #[test]
    fn extreme_positions_are_accepted() {
        let mut clusters = Clusters::new(0.1, 2, 4);
        let at = [([f32::MAX; 3], 1.0), ([f32::MIN; 3], 1.0), ([f32::MAX, 0.0, 0.0], 0.0)];
        assert_eq!(clusters.assign(at.into_iter()), 2);
    }
}
