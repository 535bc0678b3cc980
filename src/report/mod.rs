//! Stage 7, SHOW: from the records alone; and [`sheet`], figures of pictures that are handed in.

pub mod chart;
mod csv;
pub mod figures;
pub mod forecast;
pub mod histogram;
pub mod json;
mod ladder;
mod latex;
pub mod openeqa;
pub mod page;
pub mod products;
pub mod questions;
mod readable;
pub mod realism;
mod samples;
mod script;
pub mod sheet;
pub mod study;
pub mod table;
pub mod tables;
mod template;
pub mod terminal;
mod words;
