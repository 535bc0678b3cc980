//! Stage 7, SHOW: from the records alone; and [`sheet`], figures of pictures that are handed in.

pub mod files;
pub mod forecast;
pub mod histogram;
pub mod questions;
pub mod realism;
pub mod sheet;
pub mod table;
