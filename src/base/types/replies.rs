//! Replies of models, their token probabilities, and the observer that answers by rule.
//!
//! The reply of a model: [`Reply`].
//!
//! The observer's name, and its controls: [`Control`].
//!
//! The charge for a request as the server states it: [`StatedCost`], [`ServiceTier`].
//!
//! Token probabilities of a reply ([`TokenChances`]) and of the choices in a trial ([`OptionProbabilities`]).
//!
//! [`Observed`]: the observer's view of a frame when it answered.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// The reason why a model stopped.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Finish {
    /// The reply is complete.
    Stop,
    /// The token limit was reached.
    Length,
    /// A content filter stopped the reply.
    Filter,
    /// Another reason, in the server's words: of a complete reply if [`Finish::is_whole`], else of one that the server
    /// ended early.
    Other(String),
    /// Not reported by the server.
    Unknown,
}

impl Finish {
    /// Maximum length of a reason in a server's words, in characters; chosen.
    const MAX_REASON_CHARS: usize = 40;

    /// Words of replies that are complete and end in a way of their own: calls of tools (OpenAI, Anthropic), guesses of
    /// built-in models.
    const WHOLE: [&str; 4] = ["tool_calls", "function_call", "tool_use", "guess"];

    /// True if the reply is complete, so that an answer is looked for in a sentence, too. Of a reply that a filter, a
    /// limit or the server ended early, only a text that is an answer and nothing else counts.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        match self {
            Self::Stop | Self::Unknown => true,
            Self::Length | Self::Filter => false,
            Self::Other(word) => Self::WHOLE.contains(&&*Self::normalized(word)),
        }
    }

    /// A server's word in lower case, with underscores.
    #[must_use]
    pub fn normalized(word: &str) -> String {
        word.trim().to_ascii_lowercase().replace(['-', ' '], "_")
    }

    /// Shortens a reason in the server's words and removes its control characters.
    #[must_use]
    pub fn shorten(self) -> Self {
        match self {
            Self::Other(reason) => {
                let reason = reason.chars().filter(|c| !c.is_control()).take(Self::MAX_REASON_CHARS).collect();
                Self::Other(reason)
            }
            named => named,
        }
    }
}

/// The tokens that the server charged for a request; each number is `None` if the server did not report it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct Usage {
    /// The number of tokens in the prompt, image included.
    pub prompt_tokens: Option<u64>,
    /// The number of tokens in the reply, hidden reasoning included.
    pub completion_tokens: Option<u64>,
    /// The number of tokens of the prompt that the server had in its cache, which may cost less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cached_tokens: Option<u64>,
    /// The total as the server stated it; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub total_tokens: Option<u64>,
    /// The charge as the server stated it, in US dollars; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<StatedCost>,
    /// The service tier as the server stated it; not in the file if it stated none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub service_tier: Option<ServiceTier>,
}

impl Usage {
    /// The sum of prompt and reply tokens; `None` if the server stated neither.
    #[must_use]
    pub fn total(&self) -> Option<u64> {
        let (prompt, completion) = (self.prompt_tokens, self.completion_tokens);
        (prompt.is_some() || completion.is_some()).then(|| prompt.unwrap_or(0).saturating_add(completion.unwrap_or(0)))
    }

    /// True if the server stated that it charges for the request: tokens, or a cost.
    #[must_use]
    pub fn is_charged(&self) -> bool {
        let is_cost = self.cost.is_some_and(|cost| cost.dollars() > 0.0);
        is_cost || self.total().is_some_and(|tokens| tokens > 0)
    }

    /// Adds two usages; a number is unknown if it is unknown in both. If only one has a cost, the tokens of the other
    /// one count at its cost per token.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            prompt_tokens: sum(self.prompt_tokens, more.prompt_tokens),
            completion_tokens: sum(self.completion_tokens, more.completion_tokens),
            cached_tokens: sum(self.cached_tokens, more.cached_tokens),
            total_tokens: sum(self.total_tokens, more.total_tokens),
            cost: match (self.cost, more.cost) {
                (Some(cost), Some(other)) => Some(cost.plus(other)),
                (Some(cost), None) => Some(extend(cost, self, more)),
                (None, Some(cost)) => Some(extend(cost, more, self)),
                (None, None) => None,
            },
            service_tier: self.service_tier.max(more.service_tier),
        }
    }
}

/// Cost of the requests of two usages, of which only `priced` has a cost: the same cost per token for both.
fn extend(cost: StatedCost, priced: Usage, other: Usage) -> StatedCost {
    let [known, added] = [priced, other].map(|usage| usage.total().unwrap_or(0) as f64);
    if known > 0.0 { cost.times((known + added) / known) } else { cost }
}

/// Adds two numbers of which each may be unknown.
fn sum(one: Option<u64>, other: Option<u64>) -> Option<u64> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.saturating_add(other)),
        (one, other) => one.or(other),
    }
}

/// Charged attempts without a reply, with their tokens; and requests for which the server stated no tokens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct LostAttempts {
    /// The number of attempts.
    pub attempts: u32,
    /// The tokens of all attempts.
    pub usage: Usage,
    /// Requests that may have been charged although the server stated no tokens, the request of the reply included.
    /// Absent in the file if there are none.
    #[serde(default, skip_serializing_if = "Unstated::is_none")]
    pub unstated: Unstated,
}

impl LostAttempts {
    /// True if no attempt was lost and the tokens of every request are known.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.attempts == 0 && self.unstated.is_none()
    }

    /// Adds an attempt without a reply; one that was not charged does not count.
    pub fn add(&mut self, usage: Option<Usage>) {
        if let Some(usage) = usage.filter(Usage::is_charged) {
            self.attempts += 1;
            self.usage = self.usage.plus(usage);
        }
    }

    /// Adds the attempts of two trials.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            attempts: self.attempts.saturating_add(more.attempts),
            usage: self.usage.plus(more.usage),
            unstated: self.unstated.plus(more.unstated),
        }
    }
}

/// Requests that may have been charged although the server stated no tokens, or not all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub struct Unstated {
    /// The number of requests.
    pub requests: u32,
    /// Upper bound of the prompt tokens that were not stated.
    pub prompt_tokens: u64,
    /// Upper bound of the reply tokens that were not stated, hidden reasoning included.
    pub completion_tokens: u64,
}

impl Unstated {
    /// True if the server stated the tokens of every request.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.requests == 0
    }

    /// Adds two counts.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self {
            requests: self.requests.saturating_add(more.requests),
            prompt_tokens: self.prompt_tokens.saturating_add(more.prompt_tokens),
            completion_tokens: self.completion_tokens.saturating_add(more.completion_tokens),
        }
    }
}

/// One reply of a model, as it arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// The text, with its parts joined and without hidden reasoning.
    pub text: String,
    /// The text of a refusal that came separately; no answer is read from it.
    pub refusal: Option<String>,
    /// The reason why the model stopped.
    pub finish: Finish,
    /// The tokens that the server charged; `None` if it did not report them.
    pub usage: Option<Usage>,
    /// The model's name in the server's reply.
    pub served_model: Option<String>,
    /// The provider that a router passed the request on to; `None` if the server names none.
    pub provider: Option<String>,
    /// The replica of the endpoint that replied; `None` if there is one address.
    pub endpoint: Option<usize>,
    /// The time from the first byte sent to the last byte received in the last try, in milliseconds.
    pub latency_ms: u64,
    /// The number of requests that were sent.
    pub attempts: u32,
    /// The earlier attempts that were charged and gave no reply.
    pub lost: LostAttempts,
    /// The observer's view of the frame; `None` for every other model.
    pub observed: Option<Observed>,
    /// The likeliest tokens; `None` if they were not requested or the server stated none.
    pub chances: Option<TokenChances>,
    /// True if another try may end in another way: the server's word for the end is not known, or the model thought and
    /// gave no answer. Not stored.
    pub may_heal: bool,
    /// The field with the only text of a reply without content; `None` for every other reply.
    pub other_field: Option<OtherField>,
}

/// A field of a response, other than that of the content, with its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherField {
    /// The field: `reasoning_content`, the arguments of a tool call.
    pub name: String,
    /// The text.
    pub text: String,
}

impl Reply {
    /// A complete reply from this process, without cost.
    #[must_use]
    pub fn local(text: String) -> Self {
        Self {
            text,
            refusal: None,
            finish: Finish::Stop,
            usage: None,
            served_model: None,
            provider: None,
            endpoint: None,
            latency_ms: 0,
            attempts: 1,
            lost: LostAttempts::default(),
            observed: None,
            chances: None,
            may_heal: false,
            other_field: None,
        }
    }

    /// A reply without text that ended at the token limit, from a server that sent none of the text.
    #[must_use]
    pub fn empty_truncated(usage: Option<Usage>) -> Self {
        Self { finish: Finish::Length, usage, ..Self::local(String::new()) }
    }
}

/// Name of the observer in records and tables.
pub const OBSERVER: &str = "observer";

/// A control of the observer: a change of the image after which the observer should know less.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Control {
    /// The unchanged image of a frame from another scene in the same condition; the plan of the run chooses it.
    OtherRoom,
    /// Each square of 12 pixels filled with its mean. The score may stay above chance, because large things are still
    /// visible.
    Mosaic12,
    /// Each square of 40 pixels filled with its mean.
    Mosaic40,
    /// Left and right exchanged.
    Mirrored,
    /// Top and bottom exchanged.
    UpsideDown,
    /// Squares of 80 pixels, each moved to another place.
    Tiles,
    /// All pixels black.
    Black,
    /// All pixels the mean colour of the image.
    Flat,
    /// An independent, uniformly distributed code for each sample.
    WhiteNoise,
    /// Noise with the same power in each octave, like that of natural images.
    PinkNoise,
    /// Each code subtracted from 255.
    Negative,
    /// Blurred by about σ = 20 pixels.
    Blur,
    /// Shifted by 32 pixels to the right and down; pixels wrap around the edges.
    Shift32,
    /// Shifted by 4 pixels to the right and down. The score may stay above chance, because some outlines still agree.
    Shift4,
    /// Each mask filled with a random colour.
    RandomMasks,
    /// The outlines of the masks, black on grey.
    Outlines,
}

impl Control {
    /// All controls, in the order in which they are asked.
    pub const ALL: [Self; 16] = [
        Self::OtherRoom,
        Self::Mosaic12,
        Self::Mosaic40,
        Self::Mirrored,
        Self::UpsideDown,
        Self::Tiles,
        Self::Black,
        Self::Flat,
        Self::WhiteNoise,
        Self::PinkNoise,
        Self::Negative,
        Self::Blur,
        Self::Shift32,
        Self::Shift4,
        Self::RandomMasks,
        Self::Outlines,
    ];

    /// True if the image carries no information about the question, so that the score must be at chance.
    #[must_use]
    pub fn removes_all_information(self) -> bool {
        !matches!(self, Self::Shift4 | Self::Mosaic12)
    }

    /// Controls that a run with the observer asks by default: the first that is possible, which is `other-room`, or
    /// `tiles` if all frames are from one scene.
    pub const DEFAULTS: [Self; 2] = [Self::OtherRoom, Self::Tiles];

    /// The control in a model name such as `observer:tiles`, or `observer:tiles (night)` with the name of a run; `None`
    /// for other models.
    pub fn from_model_name(model: &str) -> Option<Self> {
        let name = model.strip_prefix(OBSERVER)?.strip_prefix(':')?;
        name.split_once(" (").map_or(name, |(name, _)| name).parse().ok()
    }

    /// The name as a model, `observer:NAME`.
    pub fn model_name(self) -> String {
        format!("{OBSERVER}:{self}")
    }

    /// The name, as in `observer:NAME`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OtherRoom => "other-room",
            Self::Mosaic12 => "mosaic-12",
            Self::Mosaic40 => "mosaic-40",
            Self::Mirrored => "mirrored",
            Self::UpsideDown => "upside-down",
            Self::Tiles => "tiles",
            Self::Black => "black",
            Self::Flat => "flat",
            Self::WhiteNoise => "white-noise",
            Self::PinkNoise => "pink-noise",
            Self::Negative => "negative",
            Self::Blur => "blur",
            Self::Shift32 => "shift-32",
            Self::Shift4 => "shift-4",
            Self::RandomMasks => "random-masks",
            Self::Outlines => "outlines",
        }
    }
}

impl fmt::Display for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Control {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|control| control.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("observer:{text} is not a control; there are: {names}")
        })
    }
}

/// Units per US dollar: xAI's ticks, the finest unit in which a vendor states charges
/// (docs.x.ai/developers/cost-tracking).
const PER_DOLLAR: f64 = 1e10;

/// A charge that a server states for a request, 0 or more, in units of 10⁻¹⁰ US dollars. A number of US dollars in a
/// file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StatedCost(u64);

impl StatedCost {
    /// Maximum plausible charge for one request, in US dollars; chosen: ten times the dearest known request, a million
    /// tokens of reply at 10 dollars per million.
    pub const MAX: f64 = 100.0;

    /// A charge in US dollars; `None` for a negative number, one above [`Self::MAX`], or none at all.
    #[must_use]
    pub fn from_dollars(dollars: f64) -> Option<Self> {
        (0.0..=Self::MAX).contains(&dollars).then(|| Self((dollars * PER_DOLLAR).round() as u64))
    }

    /// The charge in US dollars.
    #[must_use]
    pub fn dollars(self) -> f64 {
        self.0 as f64 / PER_DOLLAR
    }

    /// The charge in US dollars, multiplied.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self((self.0 as f64 * factor).round() as u64)
    }

    /// The sum of two charges.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self(self.0.saturating_add(more.0))
    }

    /// The number of units; only to hold a charge in memory.
    pub(crate) fn units(self) -> u64 {
        self.0
    }

    pub(crate) fn from_units(units: u64) -> Self {
        Self(units)
    }
}

impl Serialize for StatedCost {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.dollars())
    }
}

impl<'de> Deserialize<'de> for StatedCost {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let dollars = f64::deserialize(deserializer)?;
        // Sums of attempts may exceed the maximum of one request.
        if dollars.is_finite() && dollars >= 0.0 {
            Ok(Self((dollars * PER_DOLLAR).round() as u64))
        } else {
            Err(de::Error::custom("a cost of 0 or more expected"))
        }
    }
}

/// The service tier at which a server answered. Vendors charge tiers at different prices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ServiceTier {
    /// The tier of the list price.
    Standard,
    /// OpenAI, Groq, Google: slower and cheaper.
    Flex,
    /// OpenAI, Anthropic, Google: faster and dearer.
    Priority,
    /// OpenAI: paid in advance.
    Scale,
    /// Groq: faster.
    Performance,
    /// A tier of another name.
    #[serde(other)]
    Other,
}

impl ServiceTier {
    /// Number of tiers.
    pub const COUNT: usize = 6;

    /// Reads the name of a tier in a reply or a request; `None` if it leaves the tier open or names the way of a batch.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name.trim().to_lowercase().as_str() {
            "" | "auto" | "batch" => None,
            "default" | "standard" | "standard_only" | "on_demand" => Some(Self::Standard),
            "flex" => Some(Self::Flex),
            "priority" => Some(Self::Priority),
            "scale" => Some(Self::Scale),
            "performance" => Some(Self::Performance),
            _ => Some(Self::Other),
        }
    }
}

/// The likeliest tokens at the first positions of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenChances {
    /// The positions, from the first token of the reply on.
    pub positions: Vec<TokenPosition>,
    /// Whether the model reasoned before it answered.
    pub thought: Thought,
}

/// One position of a reply.
#[derive(Debug, Clone, PartialEq)]
pub struct TokenPosition {
    /// The token that the model chose.
    pub token: String,
    /// The likeliest tokens with the natural logarithms of their probabilities; each token once, the chosen one among
    /// them.
    pub likeliest: Vec<(String, f64)>,
}

/// Whether reasoning came before the answer of a reply. If so, the reasoning decided the answer, and the probability of
/// its letter is not the model's confidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thought {
    /// The model reasoned first.
    Before,
    /// No reasoning was reported.
    None,
}

/// The probability that a model gave to each choice when it answered. All numbers are finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptionProbabilities {
    /// The probability of each choice in the order shown; they add up to 1.
    pub p: Vec<f64>,
    /// The probability that the model gave to all tokens that name a choice, before it was scaled to 1.
    pub mass: f64,
    /// Upper bound of the probability of a choice whose token the server did not list, before scaling.
    pub bound: f64,
    /// The token that the model chose at the position of the answer.
    pub token: String,
    /// True if the model reasoned before the answer, so that no figure uses these numbers; not in the file otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reasoned: bool,
}

// None of their numbers is NaN.
impl Eq for TokenChances {}

impl Eq for OptionProbabilities {}

impl OptionProbabilities {
    /// The greatest probability of a choice: the model's confidence.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.p.iter().copied().fold(0.0, f64::max)
    }
}

/// The observer's view of a frame, and whether its answer follows from it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Observed {
    /// Basis of the answer.
    pub from: AnswerSource,
    /// The number of things of the frame: segments that are not tiny.
    pub things: usize,
    /// The number of things that the observer sees. It answers from these alone.
    pub seen: usize,
    /// The number of things whose whole outline is detected. It is not used for answers.
    pub detected: usize,
    /// The share of the image's variance that the untouched frame explains (R²), in millionths.
    pub explained_ppm: u32,
    /// The confirmed share of each thing's outline, in percent, rounded down, by the thing's number. A thing is seen
    /// from 50 on.
    pub outlines: BTreeMap<u32, u8>,
}

/// Basis of an answer of the observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AnswerSource {
    /// The things that the observer sees.
    Evidence,
    /// A random choice, each equally likely, because nothing that the observer sees bears on the question.
    Guess,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charges_are_read_back_as_written() {
        for dollars in [0.0, 0.026, 0.13, 1.05e-6, 0.0037756, 99.5] {
            let cost = StatedCost::from_dollars(dollars).unwrap();
            let text = serde_json::to_string(&cost).unwrap();
            let parsed: StatedCost = serde_json::from_str(&text).unwrap();
            assert_eq!(parsed, cost, "{text}");
            assert!((parsed.dollars() - dollars).abs() < 1e-10, "{text}");
        }
        assert_eq!(serde_json::to_string(&StatedCost::from_dollars(0.13)).unwrap(), "0.13");
    }

    #[test]
    fn implausible_charges_are_rejected() {
        for dollars in [-0.01, f64::NAN, f64::INFINITY, 101.0] {
            assert_eq!(StatedCost::from_dollars(dollars), None, "{dollars}");
        }
        assert!(serde_json::from_str::<StatedCost>("-1").is_err());
    }
}
