//! Stage 7, SHOW: reports from the records alone, and [`sheet`], figures of images that the caller passes in.

pub(crate) mod alert;
pub(crate) mod chart;
pub(crate) mod choice_report;
mod csv;
pub(crate) mod figures;
pub(crate) mod forecast;
pub(crate) mod histogram;
pub(crate) mod json;
mod ladder;
mod latex;
pub(crate) mod openeqa;
pub(crate) mod page;
pub(crate) mod products;
pub(crate) mod questions;
mod readable;
pub(crate) mod realism;
mod samples;
mod script;
pub(crate) mod sentences;
pub(crate) mod sheet;
pub(crate) mod short;
pub(crate) mod study;
pub(crate) mod table;
pub(crate) mod tables;
mod template;
pub(crate) mod terminal;
mod words;
