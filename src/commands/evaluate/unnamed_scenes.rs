//! The warning about frames without the scenes that their names suggest: [`unnamed_scenes`].

use crate::data::Dataset;
use crate::types::Question;
use darkqa_score::suggested_scenes::SuggestedScenes;

/// The warning; `None` if the data set has scenes, or the names of the frames suggest none.
pub(super) fn unnamed_scenes(dataset: &Dataset, questions: &[Question]) -> Option<String> {
    let frames = questions.iter().map(|question| &question.frame);
    if frames.clone().any(|frame| !dataset.scene(frame).is_empty()) {
        return None;
    }
    let suggested = SuggestedScenes::new(frames)?;
    Some(format!("{}; a \"scene\" in each question (or --map scene=COLUMN) names them", suggested.sentence()))
}
