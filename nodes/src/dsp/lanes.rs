//! Partial results of a loop, one for each lane of a vector.

/// Combines a power of two of lanes in halves: lane `k` with lane `k + N / 2`, and so on, on every instruction set in the same order.
#[inline(always)]
pub(crate) fn fold_lanes<T: Copy, const N: usize>(mut lanes: [T; N], combine: impl Fn(T, T) -> T) -> T {
    const { assert!(N.is_power_of_two()) };
    let mut width = N / 2;
    while width > 0 {
        let (low, high) = lanes.split_at_mut(width);
        low.iter_mut().zip(high).for_each(|(low, high)| *low = combine(*low, *high));
        width /= 2;
    }
    lanes[0]
}

#[cfg(test)]
mod tests {
    use super::fold_lanes;

    #[test]
    fn halves_are_combined_until_one_is_left() {
        assert_eq!(fold_lanes([1, 20, 300, 4000], |a, b| a + b), 4321);
        // (0, 2) and (1, 3) first.
        assert_eq!(fold_lanes([0, 1, 2, 3], |a, b| 10 * a + b), 10 * 2 + 13);
        assert_eq!(fold_lanes([7], |_, _| 0), 7);
    }
}
