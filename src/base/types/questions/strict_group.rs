//! Questions that are scored together: [`StrictGroup`].

use serde::{Deserialize, Serialize};

/// The group of a question in the strict score of its benchmark: a group is correct if all its questions are answered
/// correctly, as MME scores the two questions about an image (Fu et al. 2023, arXiv:2306.13394, section 2.2,
/// "accuracy+").
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct StrictGroup {
    /// The name of the group, unique in its data set.
    #[serde(rename = "group")]
    pub name: String,
    /// The number of questions in the group, at least 1; questions that cannot be asked count too.
    #[serde(rename = "group_size")]
    pub size: usize,
}
