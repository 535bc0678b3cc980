//! Accuracies of models in each condition and over the levels, compared with chance.

mod accuracy;
mod balance;
mod chance;
mod common;
mod coverage;
mod curve;
mod flips;
mod health;
mod strict_score;

pub(super) use accuracy::summarize;
pub use accuracy::{AccuracyCell, AccuracySummary};
pub use balance::{MAX_ANSWER_SHARE, UnbalancedFamily};
pub use chance::OfferedChoices;
pub(super) use common::CommonItems;
pub use common::shared_items;
pub(super) use coverage::{Coverage, Lacking, shared};
pub use curve::{Curve, FloorKind, curves};
pub(super) use curve::{CurvePoints, Floor};
pub use flips::FirstFailure;
pub(super) use flips::first_failures;
pub use health::{Health, healths};
pub use strict_score::{GroupCell, GroupChance, StrictScore};
