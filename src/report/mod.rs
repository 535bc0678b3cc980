//! Stage 7, SHOW: from the records alone.

pub mod files;
pub mod table;
