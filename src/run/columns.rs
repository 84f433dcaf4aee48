//! The numbers of an item, each by itself or in a few groups.

use foley_nodes::core::item::ItemType;

/// The numbers of an item by name: channel, column, or both; or, of an item of many numbers, groups of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    names: Vec<String>,
    grouping: Grouping,
    numbers: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Grouping {
    /// Each number by itself.
    Each,
    /// The first numbers by themselves, and all others together.
    Rest,
    /// The same column of all elements together.
    ByColumn,
}

impl Columns {
    /// Every number of an item of `width` elements.
    #[must_use]
    pub fn each(item: &ItemType, width: usize) -> Self {
        let name = |k: usize, column: &str| match (column, width) {
            ("", _) => format!("{k}"),
            (_, 1) => column.to_owned(),
            _ => format!("{k}.{column}"),
        };
        let names = (0..width).flat_map(|k| item.columns.iter().map(move |column| name(k, column)));
        Self { names: names.collect(), grouping: Grouping::Each, numbers: width * item.columns.len() }
    }

    /// Every number of an item, or at most `most` groups: each column of all elements, or the first numbers and the rest.
    #[must_use]
    pub fn at_most(most: usize, item: &ItemType, width: usize) -> Self {
        let numbers = width * item.columns.len();
        if numbers <= most {
            return Self::each(item, width);
        }
        if item.columns.len() > 1 {
            let names = item.columns.iter().map(|name| (*name).to_owned()).collect();
            return Self { names, grouping: Grouping::ByColumn, numbers };
        }
        let mut names: Vec<String> = (0..most - 1).map(|k| k.to_string()).collect();
        names.push(format!("{}..{}", most - 1, numbers - 1));
        Self { names, grouping: Grouping::Rest, numbers }
    }

    /// Names of the groups.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Numbers of an item.
    #[must_use]
    pub fn numbers(&self) -> usize {
        self.numbers
    }

    /// The group of a number of an item.
    #[must_use]
    pub fn group(&self, number: usize) -> usize {
        match self.grouping {
            Grouping::Each => number,
            Grouping::Rest => number.min(self.names.len() - 1),
            Grouping::ByColumn => number % self.names.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::item::{Described, OfItem};
    use foley_nodes::mesh::Mesh;

    #[test]
    fn many_numbers_are_grouped_by_column_or_by_their_rest() {
        let (audio, mesh) = (OfItem::<f32>::INFO, OfItem::<Mesh>::INFO);
        assert_eq!(Columns::at_most(12, audio, 2).names(), ["0", "1"]);
        let wide = Columns::at_most(4, audio, 39);
        assert_eq!(wide.names(), ["0", "1", "2", "3..38"]);
        assert_eq!([wide.group(2), wide.group(3), wide.group(38)], [2, 3, 3]);
        let vertices = Columns::at_most(12, mesh, 1000);
        assert_eq!((vertices.names().len(), vertices.numbers()), (3, 3000));
        assert_eq!([vertices.group(0), vertices.group(4), vertices.group(2999)], [0, 1, 2]);
        assert_eq!(Columns::at_most(12, mesh, 2).names()[3], "1.x");
    }
}
