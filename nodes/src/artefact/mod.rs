//! Files that people or foley write beside graphs, and that nodes read again: [`text`] for those that people edit.

pub mod sealed;
pub mod text;
pub mod value_file;
