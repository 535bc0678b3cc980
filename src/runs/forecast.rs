//! Estimated tokens, costs and time of a run before it starts: [`Forecast`].
//!
//! Power analysis of a run before it starts: [`PowerForecast`].

use serde::Serialize;

use darkqa_base::types::ProfileName;
use darkqa_base::types::text::{bytes, counted};
use darkqa_score::cluster::{ClusterUnit, Clusters};
use darkqa_score::comparisons::paired::POWER;
use darkqa_score::power::{CHANGED, CORRELATION, Detectable, PlannedSample, TARGET};
use darkqa_score::tested_sentences::RunContents;

/// Estimate for the remaining requests of one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CostLine {
    /// Name of the model, with a remark if it is asked without images.
    pub model: String,
    /// Addresses of its endpoints, without secrets.
    pub endpoints: Vec<String>,
    /// Number of requests left.
    pub requests: usize,
    /// Text tokens of all prompts.
    pub text_tokens: f64,
    /// Tokens of all images; `None` if the model's image tokens are unknown.
    pub image_tokens: Option<f64>,
    /// Tokens of all replies if each is short, such as a letter, a mark or a sentence.
    pub reply_tokens: f64,
    /// Tokens of all replies if each is as long as `--max-tokens` allows; `None` without a limit.
    pub longest_reply_tokens: Option<f64>,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
    /// Cost in dollars if each reply is as long as `--max-tokens` allows.
    pub most_dollars: Option<f64>,
    /// Tokens of one image as charged for the replies so far; `None` if there are too few replies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charged_image_tokens: Option<f64>,
    /// Ratio of the charges that the server has stated so far to the price table, by which the costs are multiplied;
    /// `None` without such charges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charge_ratio: Option<f64>,
    /// The same requests by the noise profile of their images.
    pub readings: Vec<ProfileCost>,
}

impl CostLine {
    /// The same line, with costs at this ratio to the price table.
    #[must_use]
    pub fn at_ratio(self, ratio: Option<f64>) -> Self {
        let times = |dollars: Option<f64>| dollars.map(|dollars| ratio.unwrap_or(1.0) * dollars);
        Self {
            dollars: times(self.dollars),
            most_dollars: times(self.most_dollars),
            charge_ratio: ratio,
            readings: self
                .readings
                .into_iter()
                .map(|profile| ProfileCost { dollars: times(profile.dollars), ..profile })
                .collect(),
            ..self
        }
    }
}

/// Remaining requests with images of one noise profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProfileCost {
    /// Noise profile; `None` for requests that all profiles share: L0, images without noise, and no image at all.
    pub reading: Option<ProfileName>,
    /// Number of requests left.
    pub requests: usize,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
}

/// Estimate of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Forecast {
    /// Requests left, by model.
    pub lines: Vec<CostLine>,
    /// Built-in models, which need no endpoint, and the observer's controls; each with its number of remaining trials.
    pub built_in: Vec<(String, usize)>,
    /// Number of all trials.
    pub trials: usize,
    /// Number of trials with a reply.
    pub answered: usize,
    /// Cost of the replies so far in dollars; `None` if no price is known.
    pub spent: Option<f64>,
    /// Number of images to make.
    pub images: usize,
    /// Number of images in all requests; an image counts once for each of its requests.
    pub images_sent: usize,
    /// Number of bytes to send, with images as base64.
    pub bytes: f64,
    /// Size of the largest sampled image file in bytes.
    pub largest_image: usize,
    /// Number of images that were made as a sample.
    pub sampled: usize,
    /// Reason why the endpoint would refuse the largest image; `None` if it accepts it.
    pub too_large: Option<String>,
    /// Time to make all images on this machine, in seconds.
    pub making_seconds: f64,
    /// Time of waiting for all replies, in seconds.
    pub asking_seconds: f64,
    /// Text for the assumptions behind the waiting time.
    pub pace: String,
    /// Date and source of the prices.
    pub prices: String,
    /// Charge of the Batch API as a share of the price.
    pub batch: f64,
    /// Text for the length of the shortest assumed reply.
    pub reply: &'static str,
    /// Number of frames or walks, if intervals and tests need more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub few_sources: Option<FewSources>,
    /// Smallest effect that the whole run can detect; `None` for a shard, and for questions without choices or answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power: Option<PowerForecast>,
    /// Size of the largest request in bytes, estimated from sampled images; only if requests have many images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_request: Option<f64>,
    /// Share of images that the image store can reuse; `None` without an image store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_store: Option<StoreForecast>,
}

/// Number of frames or walks that is too small for reliable intervals and tests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FewSources {
    /// Number in the run.
    pub number: usize,
    /// Number that intervals and tests need.
    pub needed: usize,
    /// Name of the sources in the singular, such as "frame".
    pub of: &'static str,
}

/// Reuse of stored images by another model that is asked about the same images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StoreForecast {
    /// Text for the kind of images that are stored.
    pub kept: &'static str,
    /// Size of all images in bytes.
    pub bytes: f64,
    /// Capacity of the store in bytes.
    pub room: f64,
    /// Share of the images that the store can return, from 0 to 1.
    pub hits: f64,
}

impl StoreForecast {
    /// Forecast for images of a total size and a store of a capacity, both in bytes.
    pub fn new(kept: &'static str, bytes: f64, room: f64) -> Self {
        let hits = if bytes > room { room / bytes } else { 1.0 };
        Self { kept, bytes, room, hits }
    }

    /// Formats the forecast as one line.
    pub fn line(&self) -> String {
        let (kept, set, room) = (self.kept, bytes(self.bytes), bytes(self.room));
        let percent = 100.0 * self.hits;
        format!("image store: {kept} {set}, room {room}: the next model finds about {percent:.0} % of them\n")
    }
}

/// Smallest difference between two conditions that a run can detect, and the number of clusters needed to detect 5
/// points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PowerForecast {
    /// Number of questions.
    pub questions: usize,
    pub clusters: usize,
    /// Name of a cluster: scene, frame or question.
    pub unit: String,
    /// Number of models whose mean is tested.
    pub models: usize,
    /// Verdict level of the test, after the report's correction.
    pub level: f64,
    #[serde(flatten)]
    pub detectable: Detectable,
}

impl PowerForecast {
    /// Computes the forecast. `question_clusters` has the cluster index of each question; `None` without questions.
    pub fn new(clusters: &Clusters, question_clusters: &[u32], contents: RunContents) -> Option<Self> {
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
    pub fn line(&self) -> String {
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
    use darkqa_base::types::{FrameId, QuestionId};
    use darkqa_score::cluster::FrameTies;

    #[test]
    fn hits_are_limited_by_the_store_capacity() {
        let [too_large, fitting] = [80e9, 20e9].map(|bytes| StoreForecast::new("enhanced images", bytes, 20e9));
        assert!((too_large.hits - 0.25).abs() < 1e-12);
        assert!((fitting.hits - 1.0).abs() < 1e-12);
        assert_eq!(
            too_large.line(),
            "image store: enhanced images 80.0 GB, room 20.0 GB: the next model finds about 25 % of them\n"
        );
    }

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
