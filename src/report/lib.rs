//! Reports, made from stored records: text for the terminal, HTML pages and files.

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod accuracy;
pub mod charts;
pub mod content;
mod finding_groups;
pub mod forecast;
pub mod joined;
pub mod json;
pub mod markdown;
pub mod openeqa;
pub mod outputs;
pub mod page;
pub mod questions;
pub mod realism;
pub mod self_agreement;
pub mod sentences;
pub mod short;
pub mod site;
pub mod study;
pub mod tables;
pub mod template;
pub mod text;
