//! Power analysis of a run before it starts: [`PowerForecast`].

use serde::Serialize;

use crate::types::text::counted;
use darkqa_score::cluster::{ClusterUnit, Clusters};
use darkqa_score::comparisons::paired::POWER;
use darkqa_score::power::{CHANGED, CORRELATION, Detectable, PlannedSample, TARGET};
use darkqa_score::tested_sentences::RunContents;

/// Smallest difference between two conditions that a run can detect, and the number of clusters needed to detect 5
/// points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PowerForecast {
    /// Number of questions.
    pub questions: usize,
    pub clusters: usize,
    /// Name of a cluster: scene, frame or question.
    pub unit: String,
    /// Number of models whose mean is tested.
    pub models: usize,
    /// Significance level of the test, after the report's correction.
    pub level: f64,
    #[serde(flatten)]
    pub detectable: Detectable,
}

impl PowerForecast {
    /// Computes the forecast. `question_clusters` has the cluster index of each question; `None` without questions.
    pub(crate) fn new(clusters: &Clusters, question_clusters: &[u32], contents: RunContents) -> Option<Self> {
        let mut questions = vec![0; clusters.count()];
        for cluster in question_clusters {
            questions[*cluster as usize] += 1;
        }
        questions.retain(|count| *count > 0);
        if questions.is_empty() {
            return None;
        }
        let sample =
            PlannedSample { questions, models: contents.models.max(1), level: contents.first_significance_level() };
        Some(Self {
            questions: question_clusters.len(),
            clusters: sample.questions.len(),
            unit: clusters.unit().to_string(),
            models: sample.models,
            level: sample.level,
            detectable: sample.detectable(),
        })
    }

    /// Formats the forecast as one line, without a line break.
    pub(crate) fn line(&self) -> String {
        let among = if self.unit == ClusterUnit::Question.to_string() {
            counted(self.questions, "question")
        } else {
            format!("{} in {}", counted(self.questions, "question"), counted(self.clusters, &self.unit))
        };
        let power = 100.0 * POWER;
        let found = match self.detectable.difference {
            None => "detects no difference between two conditions".to_owned(),
            Some(difference) => {
                format!("detects {:.1} points between two conditions in {power:.0} % of such runs", 100.0 * difference)
            }
        };
        let who = match self.models {
            1 => "one model".to_owned(),
            models => format!("mean of {models} models"),
        };
        format!(
            "power: {among} {found}; {:.0} points need about {} ({who}; level {:.2} % after correction; assumed: {:.0} % of answers change without an effect, correlation {CORRELATION} in a {})",
            100.0 * TARGET,
            counted(self.detectable.clusters_for_target, &self.unit),
            100.0 * self.level,
            100.0 * CHANGED,
            self.unit
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{FrameId, QuestionId};
    use darkqa_score::cluster::FrameTies;

    fn forecast(frames: usize, models: usize) -> PowerForecast {
        let questions: Vec<(QuestionId, FrameId)> =
            (0..4 * frames).map(|item| (QuestionId(format!("q{item}")), FrameId(format!("f{}", item / 4)))).collect();
        let pairs = questions.iter().map(|(question, frame)| (question, frame));
        let clusters = Clusters::new(pairs, &FrameTies::default());
        let question_clusters: Vec<u32> =
            questions.iter().map(|(question, frame)| clusters.get(frame, question).unwrap()).collect();
        let contents = RunContents { models, enhancers: 1, lights: 1, has_noise: true };
        PowerForecast::new(&clusters, &question_clusters, contents).unwrap()
    }

    #[test]
    fn the_line_states_difference_and_assumptions() {
        let line = forecast(42, 1).line();
        assert!(
            line.starts_with("power: 168 questions in 42 frames detects ")
                && line.contains(" points between two conditions in 80 % of such runs; 5 points need about ")
                && line.ends_with(" frames (one model; level 0.83 % after correction; assumed: 20 % of answers change without an effect, correlation 0.05 in a frame)"),
            "{line}"
        );
        let (one, six) = (forecast(42, 1).detectable, forecast(42, 6).detectable);
        assert!(six.difference < one.difference && six.clusters_for_target < one.clusters_for_target);
        let few = forecast(3, 1).line();
        assert!(few.starts_with("power: 12 questions in 3 frames detects no difference"), "{few}");
    }
}
