//! One folder or file a command. What several of them need is in [`job`](crate::job) or below; no command uses another's folder.

pub(crate) mod batch;
pub(crate) mod enhance;
pub(crate) mod evaluate;
pub(crate) mod export;
pub(crate) mod import;
pub(crate) mod openeqa;
pub(crate) mod questions;
pub(crate) mod realism;
pub(crate) mod rooms;
pub(crate) mod serve;
pub(crate) mod show;
pub(crate) mod study;
pub(crate) mod synthesize;
