//! Estimated tokens, costs and time of a run before it starts: [`Forecast`].

use serde::Serialize;

use super::power_forecast::PowerForecast;
use crate::types::ProfileName;
use crate::types::text::bytes;

/// Estimate for the remaining requests of one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CostLine {
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
    pub(crate) fn at_ratio(self, ratio: Option<f64>) -> Self {
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
pub(crate) struct ProfileCost {
    /// Noise profile; `None` for requests that all profiles share: L0, images without noise, and no image at all.
    pub reading: Option<ProfileName>,
    /// Number of requests left.
    pub requests: usize,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
}

/// Estimate of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Forecast {
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
pub(crate) struct FewSources {
    /// Number in the run.
    pub number: usize,
    /// Number that intervals and tests need.
    pub needed: usize,
    /// Name of the sources in the singular, such as "frame".
    pub of: &'static str,
}

/// Reuse of stored images by another model that is asked about the same images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct StoreForecast {
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
    pub(crate) fn new(kept: &'static str, bytes: f64, room: f64) -> Self {
        let hits = if bytes > room { room / bytes } else { 1.0 };
        Self { kept, bytes, room, hits }
    }

    /// Formats the forecast as one line.
    pub(crate) fn line(&self) -> String {
        let (kept, set, room) = (self.kept, bytes(self.bytes), bytes(self.room));
        let percent = 100.0 * self.hits;
        format!("image store: {kept} {set}, room {room}: the next model finds about {percent:.0} % of them\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
