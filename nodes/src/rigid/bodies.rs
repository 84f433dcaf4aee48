//! Which number a body has.

use std::collections::HashMap;

/// Most bodies that a log may name.
pub const MAX_BODIES: usize = 1 << 16;

/// Numbers of bodies: places in a list of names; without one, the log's own numbers, or 0 for `world` and then as they come.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    listed: usize,
    numbers: HashMap<String, u32>,
    names: Vec<(u32, String)>,
    next: u32,
}

impl Bodies {
    /// Bodies of these names have their places as numbers; others come after them.
    #[must_use]
    pub fn new(list: &[String]) -> Self {
        let numbers: HashMap<String, u32> = list.iter().cloned().zip(0..).collect();
        Self { listed: list.len(), numbers, names: Vec::new(), next: list.len().max(1) as u32 }
    }

    /// The number of a body; `None` where there are too many.
    pub(super) fn number(&mut self, name: &str, own: Option<u32>) -> Option<u32> {
        if self.listed == 0 {
            if let Some(own) = own {
                return Some(own);
            }
            if name == "world" {
                return Some(0);
            }
        }
        if let Some(number) = self.numbers.get(name) {
            return Some(*number);
        }
        if self.names.len() == MAX_BODIES {
            return None;
        }
        let number = self.next;
        self.next += 1;
        self.numbers.insert(name.to_owned(), number);
        self.names.push((number, name.to_owned()));
        Some(number)
    }

    /// Bodies that no list names, with the numbers that they got.
    #[must_use]
    pub fn unlisted(&self) -> &[(u32, String)] {
        &self.names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_bodies_have_their_places_and_others_follow() {
        let mut bodies = Bodies::new(&["floor".into(), "ball".into()]);
        assert_eq!(bodies.number("ball", Some(7)), Some(1));
        assert_eq!(bodies.number("box", Some(0)), Some(2));
        assert_eq!(bodies.number("box", None), Some(2));
        let mut bodies = Bodies::new(&[]);
        assert_eq!(bodies.number("ball", Some(7)), Some(7));
        assert_eq!([bodies.number("box", None), bodies.number("world", None)], [Some(1), Some(0)]);
    }
}
