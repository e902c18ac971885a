//! Recordings: the CSV files that rigs write, one run each, and files of other formats that become such when they are opened.
//!
//! [`Recording`] reads row by row in bounded memory, as often as needed; [`Memory`] is a whole recording by shared
//! columns, [`Run`] one by columns of its own; [`RecordingWriter`] writes one. Lines that start with `#` are comments, an empty cell or
//! `nan` is missing, columns that the tool does not know are kept under their header.

mod header;
mod memory;
mod position;
mod reader;
mod run;
mod table;
mod utf8;
mod writer;

pub use header::{Channel, Header, Required};
pub use memory::{Memory, SharedColumn};
pub use reader::{Recording, Row, Rows};
pub use run::Run;
pub use writer::{RecordingWriter, push_exact, write_comments};
