//! One folder or file a command. What several of them need is in [`job`](crate::job) or below; no command uses another's folder.

pub mod batch;
pub mod enhance;
pub mod evaluate;
pub mod export;
pub mod import;
pub mod openeqa;
pub mod questions;
pub mod realism;
pub mod rooms;
pub mod serve;
pub mod show;
pub mod study;
pub mod synthesize;
