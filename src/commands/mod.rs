//! One folder or file per command. Shared code is in [`engine`](darkqa_engine), [`report`](darkqa_report) or below; no
//! command uses the folder of another.

pub(crate) mod batch;
pub(crate) mod bundle;
pub(crate) mod cache;
pub(crate) mod calibrate;
pub mod cli;
pub(crate) mod enhance;
pub(crate) mod evaluate;
pub(crate) mod export;
pub(crate) mod figures;
pub(crate) mod import;
pub(crate) mod init;
pub(crate) mod merge;
pub(crate) mod models;
pub(crate) mod openeqa;
pub(crate) mod questions;
pub(crate) mod realism;
pub(crate) mod rooms;
pub(crate) mod serve;
pub(crate) mod show;
pub(crate) mod site;
pub(crate) mod study;
pub(crate) mod synthesize;
