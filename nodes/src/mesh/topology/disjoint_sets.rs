//! Connected components by union-find.

/// Disjoint sets of vertices as a forest of parent indices.
pub(crate) struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// One set per vertex.
    pub(crate) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// Root of the set of a vertex; halves the path on the search.
    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            let grandparent = self.0[self.0[v as usize] as usize];
            self.0[v as usize] = grandparent;
            v = grandparent;
        }
        v
    }

    /// Merges the sets of two vertices.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The lower vertex becomes the root, so that indices follow the order of vertices.
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// Returns the index of the set of each vertex, and the number of sets.
    pub(crate) fn number(mut self) -> (Vec<u32>, usize) {
        let mut numbers = vec![0; self.0.len()];
        let mut next = 0;
        for v in 0..self.0.len() as u32 {
            let root = self.root(v);
            numbers[v as usize] = if root == v {
                next += 1;
                next - 1
            } else {
                numbers[root as usize]
            };
        }
        (numbers, next as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_in_the_order_of_their_first_vertices() {
        let mut sets = DisjointSets::new(5);
        sets.join(4, 1);
        sets.join(3, 0);
        assert_eq!(sets.number(), (vec![0, 1, 2, 0, 1], 3));
    }
}
