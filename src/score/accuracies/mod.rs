//! Accuracies of models in each condition and over the levels, compared with chance.

mod accuracy;
mod balance;
mod curve;
mod health;
mod strict_score;

pub(super) use accuracy::{CommonItems, summarize};
pub(super) use curve::{CurvePoints, Floor, first_failures};
pub(super) use health::{Lacking, LevelCoverage, shared};

pub use accuracy::{AccuracyCell, AccuracySummary, OfferedChoices, shared_items};
pub use balance::{MAX_ANSWER_SHARE, UnbalancedFamily};
pub use curve::{Curve, FirstFailure, FloorKind, curves};
pub use health::{Health, healths};
pub use strict_score::{GroupCell, GroupChance, StrictScore};
