//! Reports, made from stored records: text for the terminal, HTML pages and files.

pub(crate) mod accuracy;
pub(crate) mod charts;
pub(crate) mod content;
mod finding_groups;
pub(crate) mod forecast;
pub(crate) mod joined;
pub(crate) mod json;
pub(crate) mod markdown;
pub(crate) mod openeqa;
pub(crate) mod outputs;
pub(crate) mod page;
pub(crate) mod questions;
pub(crate) mod realism;
pub(crate) mod self_agreement;
pub(crate) mod sentences;
pub(crate) mod short;
pub(crate) mod site;
pub(crate) mod study;
pub(crate) mod tables;
pub(crate) mod template;
pub(crate) mod text;
