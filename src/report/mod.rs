//! Stage 7, SHOW: from the records alone; and [`sheet`], figures of pictures that are handed in.

pub mod chart;
pub mod csv;
pub mod figures;
pub mod files;
pub mod forecast;
pub mod histogram;
mod ladder;
pub mod latex;
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
pub mod subject;
pub mod table;
mod template;
pub mod verdicts;
