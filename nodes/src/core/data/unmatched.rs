//! Items that a filter refused, for the report of a node that stays silent.

use serde::{Deserialize, Serialize};
use std::fmt::Display;

/// Maximum number of different keys that are remembered.
const MOST: usize = 16;

/// The first 16 different keys of the items that a filter has refused, such as numbers of objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unmatched<K> {
    keys: [Option<K>; MOST],
    more: bool,
}

impl<K: Copy> Default for Unmatched<K> {
    fn default() -> Self {
        Self { keys: [None; MOST], more: false }
    }
}

impl<K: Copy + PartialEq> Unmatched<K> {
    /// Remembers the key of an item.
    pub fn add(&mut self, key: K) {
        if self.keys.iter().flatten().any(|known| *known == key) {
            return;
        }
        match self.keys.iter_mut().find(|slot| slot.is_none()) {
            Some(slot) => *slot = Some(key),
            None => self.more = true,
        }
    }

    /// Returns true if nothing was refused.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.keys[0].is_none()
    }

    /// Returns the keys, each as `text` has it: "1, 4", or "1, 4 and more".
    pub fn list<T: Display>(&self, text: impl Fn(K) -> T) -> String {
        let keys: Vec<String> = self.keys.iter().flatten().map(|key| text(*key).to_string()).collect();
        let more = if self.more { " and more" } else { "" };
        format!("{}{more}", keys.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_keys_are_listed_once_each() {
        let mut all = Unmatched::default();
        assert!(all.is_empty());
        [4, 1, 4].into_iter().for_each(|key| all.add(key));
        assert_eq!(all.list(|key| key), "4, 1");
        (10..30).for_each(|key| all.add(key));
        assert_eq!(
            all.list(|key| key),
            "4, 1, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23 and more"
        );
    }
}
