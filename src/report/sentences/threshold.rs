//! Sentences about how dark it may be: the exposure drop at which half of what images add is lost ([`seen_down_to`],
//! [`evidence_down_to`]).

use std::fmt::Write as _;

use super::sentence::{EffectDirection, NamedNumbers, Sentence};
use crate::text::words::{light, lux, stops};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::accuracies::{Curve, FloorKind};
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::photographs::PhotographedSet;
use darkqa_score::threshold::Threshold;

/// Maximum number of models that a sentence names (chosen); the table of thresholds has all.
const MAX_MODELS: usize = 3;

/// Maximum number of enhancers that a sentence names (chosen).
const MAX_ENHANCERS: usize = 3;

/// The sentence about the accuracy of the pooled models with a variant; `None` if no threshold of raw images is known.
pub(super) fn seen_down_to(findings: &Findings<'_>, variant: &Variant) -> Vec<Sentence> {
    let models = findings.models_of(variant);
    let curves: Vec<&Curve> = findings
        .curves
        .iter()
        .filter(|curve| curve.family.is_none() && curve.variant == *variant && models.contains(&&*curve.model))
        .collect();
    let is_blind = curves.iter().any(|curve| curve.floor == FloorKind::Blind);
    let known = curves.iter().filter_map(|curve| {
        Some(KnownThreshold {
            model: &curve.model,
            enhancer: curve.enhancer.as_ref(),
            threshold: curve.summary.threshold.as_ref().ok().copied()?,
            darkest: curve.summary.darkest,
        })
    });
    let writer = Writer {
        grid: &findings.grid,
        variant,
        set: findings.set,
        what: if is_blind { "what images add" } else { "the lead over guessing" },
        light: None,
        numbers: NamedNumbers::new(findings.unit),
    };
    let sentence = writer.sentence(known.collect(), models.len(), |numbers, model| {
        let floor = curves.iter().find(|curve| curve.model == model && curve.enhancer.is_none());
        floor.map_or_else(String::new, |curve| {
            let share = numbers.percent("floor", curve.summary.floor);
            format!("half-way from accuracy at L0 to {share} %, the floor of {model} ({})", curve.floor.name())
        })
    });
    sentence.into_iter().collect()
}

/// The sentence about the agreement of a model with its own answers at L0; `None` if its threshold is not known.
pub(super) fn evidence_down_to(found: &SelfAgreement<'_>, model: &str, variant: &Variant) -> Option<Sentence> {
    let own = found.curves.iter().filter(|curve| curve.model == model && curve.variant == *variant);
    let known = own.filter_map(|curve| {
        Some(KnownThreshold {
            model: &curve.model,
            enhancer: curve.enhancer.as_ref(),
            threshold: curve.threshold.as_ref().ok().copied()?,
            darkest: curve.darkest,
        })
    });
    let writer = Writer {
        grid: &found.grid,
        variant,
        set: found.set,
        what: "the evidence of its images",
        light: Some(light(variant, None)),
        numbers: NamedNumbers::new(found.unit),
    };
    writer.sentence(known.collect(), 1, |_, _| "half-way from its agreement at L0 to that without images".to_owned())
}

/// A known threshold of a model, raw or with an enhancer.
struct KnownThreshold<'f> {
    model: &'f str,
    enhancer: Option<&'f EnhancerName>,
    threshold: Threshold,
    darkest: AxisLevel,
}

/// Writes the sentence about one variant.
struct Writer<'f, 'a> {
    grid: &'f Grid<'a>,
    variant: &'f Variant,
    /// The light at L0.
    set: PhotographedSet,
    /// Quantity of which half is lost at the threshold.
    what: &'static str,
    /// The light in words, if the sentence names it.
    light: Option<String>,
    numbers: NamedNumbers,
}

impl Writer<'_, '_> {
    /// The sentence; `asked` is the number of models that it is about, and `floor` describes the floor of a model.
    fn sentence(
        mut self,
        known: Vec<KnownThreshold<'_>>,
        asked: usize,
        floor: impl Fn(&mut NamedNumbers, &str) -> String,
    ) -> Option<Sentence> {
        let (raw, enhanced): (Vec<_>, Vec<_>) = known.into_iter().partition(|known| known.enhancer.is_none());
        let first = raw.first()?;
        let text = if asked == 1 { self.one_model(first, &enhanced) } else { self.several_models(&raw, asked) };
        let floor = floor(&mut self.numbers, first.model);
        let exposed = match self.set.exposed {
            Some(images) if self.axis() == Axis::LIGHT => {
                let images = self.numbers.count("exposed", images);
                format!("; lux at L0 estimated from the camera settings of {images} images, as its meter would")
            }
            _ => String::new(),
        };
        let detail = format!("{floor}{exposed}; an estimate with its interval, not a test");
        Some(self.numbers.sentence("threshold", EffectDirection::Note, text, detail))
    }

    /// The threshold of the only model, with its place between the levels, then those with the enhancers.
    fn one_model(&mut self, raw: &KnownThreshold<'_>, enhanced: &[KnownThreshold<'_>]) -> String {
        let KnownThreshold { model, threshold, darkest, .. } = raw;
        let what = self.what;
        let light = self.light.as_ref().map_or_else(String::new, |light| format!(", {light}"));
        let mut text = if threshold.value.is_infinite() {
            let low = self.beginning(*threshold);
            format!("{model} keeps more than half of {what} at all levels, down to {darkest}{low}{light}")
        } else {
            let (drop, place) = (self.drop("", raw), self.place(raw));
            format!("{model} keeps half of {what} down to {drop}{place}{light}")
        };
        for known in enhanced.iter().take(MAX_ENHANCERS) {
            let Some(name) = known.enhancer else { continue };
            let drop = self.drop(&format!("_{name}"), known);
            let _ = write!(text, "; with {name} down to {drop}");
        }
        if enhanced.len() > MAX_ENHANCERS {
            let more = self.numbers.count("more", enhanced.len() - MAX_ENHANCERS);
            let _ = write!(text, "; {more} more enhancers in the table of thresholds");
        }
        text + "."
    }

    /// The thresholds of several models; `asked` is the number of models asked, also of those without a threshold.
    fn several_models(&mut self, raw: &[KnownThreshold<'_>], asked: usize) -> String {
        let shown: Vec<String> = raw
            .iter()
            .take(MAX_MODELS)
            .map(|known| format!("{} {}", known.model, self.drop(&format!("_{}", known.model), known)))
            .collect();
        let more = match asked.saturating_sub(shown.len()) {
            0 => String::new(),
            more => format!("; {} more in the table of thresholds", self.numbers.count("more", more)),
        };
        format!("Half of {} is left down to: {}{more}.", self.what, shown.join(", "))
    }

    fn axis(&self) -> Axis {
        self.variant.kind.map_or(Axis::LIGHT, Kind::axis)
    }

    /// A threshold with its interval, and the light there if that at L0 is known. The names end in `at`.
    fn drop(&mut self, at: &str, known: &KnownThreshold<'_>) -> String {
        let Threshold { value, low, high } = known.threshold;
        let (axis, darkest) = (self.axis(), known.darkest.value());
        let mut number = |name: &str, value: f64| {
            let (name, value_there) =
                if value.is_finite() { (format!("{name}{at}"), value) } else { ("darkest".to_owned(), darkest) };
            self.numbers.number(&name, value_there, 1);
            stops(value, darkest)
        };
        let drop = number("threshold", value);
        let ends = if low.is_infinite() {
            String::new()
        } else {
            format!(" [{}, {}]", number("threshold_low", low), number("threshold_high", high))
        };
        let drop = format!("{drop} {}{ends}", axis.unit);
        match self.set.lux.filter(|_| axis == Axis::LIGHT && value.is_finite()) {
            None => drop,
            Some(at_l0) => {
                let light = lux(at_l0, value);
                let in_the_light = lux(at_l0, 0.0);
                self.numbers.record(&format!("lux{at}"), &light);
                self.numbers.record("lux_L0", &in_the_light);
                format!("{drop}, {light} of {in_the_light} lux")
            }
        }
    }

    /// Where the interval of a threshold beyond the darkest level begins; empty if that is beyond it, too.
    fn beginning(&mut self, threshold: Threshold) -> String {
        if threshold.low.is_infinite() {
            return String::new();
        }
        let unit = self.axis().unit;
        let low = self.numbers.number("threshold_low", threshold.low, 1);
        format!(" (the interval begins at {low} {unit})")
    }

    /// The asked levels around a threshold.
    fn place(&self, known: &KnownThreshold<'_>) -> String {
        let mut levels: Vec<AxisLevel> = self
            .grid
            .subjects
            .iter()
            .filter(|subject| subject.model == known.model && subject.enhancer.is_none())
            .filter(|subject| subject.level == Some(AxisLevel::L0) || subject.variant == *self.variant)
            .filter_map(|subject| subject.level)
            .collect();
        levels.sort_unstable();
        let value = known.threshold.value;
        let below = levels.iter().rev().find(|level| level.value() < value);
        let above = levels.iter().find(|level| level.value() >= value);
        match (below, above) {
            (Some(below), Some(above)) => format!(", between {below} and {above}"),
            _ => String::new(),
        }
    }
}
