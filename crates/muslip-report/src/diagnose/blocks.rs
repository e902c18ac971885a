//! What the parts of a diagnosis' page are made of.

use crate::page::{Block, Section};
use crate::table::Table;

pub(super) fn section(heading: &str, blocks: Vec<Block>) -> Section {
    Section {
        heading: heading.into(),
        blocks,
    }
}

pub(super) fn table<const N: usize>(head: [&str; N], rows: Vec<[String; N]>) -> Block {
    Block::Table(Table::new(head, rows))
}
