//! Sets of nodes of a level.

/// Nodes of one level, as intervals in increasing order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSet(Vec<(u32, u32)>);

impl NodeSet {
    /// The union of intervals.
    #[must_use]
    pub fn new(mut all: Vec<(u32, u32)>) -> Self {
        all.retain(|(from, to)| to > from);
        all.sort_unstable();
        let mut merged: Vec<(u32, u32)> = Vec::with_capacity(all.len());
        for (from, to) in all {
            match merged.last_mut() {
                Some(last) if from <= last.1 => last.1 = last.1.max(to),
                _ => merged.push((from, to)),
            }
        }
        Self(merged)
    }

    /// The nodes of this set that are not in another one.
    #[must_use]
    pub fn without(&self, other: &Self) -> Self {
        let mut left = Vec::new();
        let mut next = 0;
        for (from, to) in &self.0 {
            let mut from = *from;
            while other.0.get(next).is_some_and(|(_, end)| *end <= from) {
                next += 1;
            }
            let mut k = next;
            while let Some((start, end)) = other.0.get(k).filter(|(start, _)| start < to) {
                left.push((from, *start));
                from = from.max(*end);
                k += 1;
            }
            left.push((from, *to));
        }
        Self::new(left)
    }

    /// True if a node is one of them.
    ///
    /// # Complexity
    /// Logarithmic in the intervals.
    #[must_use]
    pub fn contains(&self, node: u32) -> bool {
        match self.0.as_slice() {
            [(from, to)] => (*from..*to).contains(&node),
            all => {
                let k = all.partition_point(|(from, _)| *from <= node);
                k > 0 && node < all[k - 1].1
            }
        }
    }

    /// The number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.iter().map(|(from, to)| (to - from) as usize).sum()
    }

    /// The union of sets.
    #[must_use]
    pub fn union<'a>(sets: impl Iterator<Item = &'a Self>) -> Self {
        Self::new(sets.flat_map(|set| set.0.iter().copied()).collect())
    }

    /// True if there is no node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All nodes, in increasing order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.iter().flat_map(|(from, to)| *from..*to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;

    #[test]
    fn sets_are_those_of_their_nodes() {
        let mut rng = Rng::new(7);
        for _ in 0..200 {
            let mut set = || {
                let one = |rng: &mut Rng| {
                    let from = rng.below(40) as u32;
                    (from, from + rng.below(6) as u32)
                };
                NodeSet::new((0..rng.below(6)).map(|_| one(&mut rng)).collect())
            };
            let (a, b) = (set(), set());
            let nodes = |is_in: &dyn Fn(u32) -> bool| (0..50).filter(|m| is_in(*m)).collect::<Vec<u32>>();
            assert_eq!(a.iter().collect::<Vec<_>>(), nodes(&|m| a.contains(m)));
            assert_eq!(a.len(), a.iter().count());
            assert_eq!(a.without(&b).iter().collect::<Vec<_>>(), nodes(&|m| a.contains(m) && !b.contains(m)));
            let union = NodeSet::union([&a, &b].into_iter());
            assert_eq!(union.iter().collect::<Vec<_>>(), nodes(&|m| a.contains(m) || b.contains(m)));
            assert_eq!(a.without(&a), NodeSet::default());
        }
    }
}
