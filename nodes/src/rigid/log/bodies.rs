//! Numbers of bodies.

use std::collections::HashMap;

/// Largest number of bodies in a log.
pub const MAX_BODIES: usize = 1 << 16;

/// Numbers of bodies: indices in a list of names; without a list the numbers of the log, or 0 for `world` and then by order of
/// appearance.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    listed: usize,
    numbers: HashMap<String, u32>,
    unlisted: Vec<(u32, String)>,
    next: u32,
}

impl Bodies {
    /// Bodies with these names have their indices as numbers; others have the numbers after them.
    #[must_use]
    pub fn new(list: &[String]) -> Self {
        let numbers: HashMap<String, u32> = list.iter().cloned().zip(0..).collect();
        Self { listed: list.len(), numbers, unlisted: Vec::new(), next: list.len().max(1) as u32 }
    }

    /// Number of a body, by its name and the number in the log; `None` if there are more than [`MAX_BODIES`].
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
        if self.unlisted.len() == MAX_BODIES {
            return None;
        }
        let number = self.next;
        self.next += 1;
        self.numbers.insert(name.to_owned(), number);
        self.unlisted.push((number, name.to_owned()));
        Some(number)
    }

    /// Returns the bodies that are not in the list, with their numbers.
    #[must_use]
    pub fn unlisted(&self) -> &[(u32, String)] {
        &self.unlisted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_bodies_have_their_indices_and_others_follow() {
        let mut bodies = Bodies::new(&["floor".into(), "ball".into()]);
        assert_eq!(bodies.number("ball", Some(7)), Some(1));
        assert_eq!(bodies.number("box", Some(0)), Some(2));
        assert_eq!(bodies.number("box", None), Some(2));
        let mut bodies = Bodies::new(&[]);
        assert_eq!(bodies.number("ball", Some(7)), Some(7));
        assert_eq!([bodies.number("box", None), bodies.number("world", None)], [Some(1), Some(0)]);
    }
}
