//! Stage 5, JUDGE: a reply → a choice; records → numbers.

pub mod accuracy;
pub mod chance;
pub mod choice;
pub mod estimate;
pub mod realism;
