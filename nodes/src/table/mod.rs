//! Tables of results with their charts, and the node that writes them.

mod result_table;
pub mod table_out;

pub use result_table::{Cell, ResultTable};
