//! Replies of models, their token probabilities, and the observer that answers by rule.

mod control;
mod observed;
mod option_probabilities;
mod reply;
mod stated_cost;

pub use control::{Control, OBSERVER};
pub use observed::{AnswerSource, Observed};
pub use option_probabilities::{OptionProbabilities, Thought, TokenChances, TokenPosition};
pub use reply::{Finish, LostAttempts, OtherField, Reply, Unstated, Usage};
pub use stated_cost::{ServiceTier, StatedCost};
