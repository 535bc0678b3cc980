//! Trials of expressions for outputs that are not the image itself: residuals, gains and light maps.

use super::endpoints::Endpoints;
use super::probe::{PairTrial, Probe};
use super::probe_run::Trials;
use super::range_pair::RangePair;
use crate::conventions::sidecar::ADD;
use crate::conventions::{Channels, ValueRange};
use crate::enhancer::Enhancer;
use crate::outputs::{expression_name, light_map_line};
use darkqa_base::error::Result;
use darkqa_base::types::{Flaw, Rgb};

/// Threshold in codes, chosen. An output up to it for white may be a residual, and one whose difference between white
/// and black is up to it may be a map. Models that return the image itself exceed 230.
const MIN_CONTRAST: f64 = 64.0;

/// Expressions that may give the image, with the kind of output that they suit. `OUTPUT` is the placeholder of the
/// output's name.
const EXPRESSIONS: [(&str, &str); 5] = [
    ("input + OUTPUT", "a residual"),
    ("input - OUTPUT", "a residual"),
    ("input * OUTPUT", "a gain"),
    // Not clipped, so that an output of faint noise gives values out of range and is rejected.
    ("input / max(OUTPUT, 0.001)", "a light map"),
    ("1 - OUTPUT", "the negative"),
];

/// Parts of the names of outputs that are not the image but are combined with the input.
const NAMES: [&str; 8] = ["illu", "light_map", "lightmap", "gain", "curve", "residual", "noise", "mask"];

/// Kind of an output that is not the image itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OutputKind {
    /// Nearly black for a white image: to be added to the input.
    Residual,
    /// As bright for black as for white: to be multiplied with the input, or a divisor of it.
    Map,
}

impl OutputKind {
    /// Kind of an output with these values for black and white; `None` if it may be the image.
    fn from_endpoints(endpoints: Endpoints) -> Option<Self> {
        let Endpoints { black, white, .. } = endpoints;
        if white <= MIN_CONTRAST {
            Some(Self::Residual)
        } else if white - black <= MIN_CONTRAST {
            Some(Self::Map)
        } else {
            None
        }
    }
}

/// Trial of an expression of input and output.
pub(super) struct ExpressionTrial {
    /// The expression, such as `input + output`.
    pub(super) text: String,
    /// Kind of the output, such as `a residual`.
    pub(super) kind: &'static str,
    pub(super) pair: PairTrial,
}

impl Enhancer {
    /// Trials of [`EXPRESSIONS`], in 0..1 where no range is stated; empty if the image is an expression already, or if
    /// the model fails.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(super) fn expression_trials(&self, dark: &[Rgb]) -> Result<Vec<ExpressionTrial>> {
        if !self.reads_plain_image() {
            return Ok(Vec::new());
        }
        let ranges = self.stated_ranges().map(|range| range.or(Some(ValueRange::Unit)));
        let name = expression_name(&self.graph().signature.outputs[0].port.name);
        let texts = EXPRESSIONS.map(|(text, _)| text.replace("OUTPUT", &name));
        let mut conventions = texts.clone().map(|_| self.convention().clone());
        for (convention, text) in conventions.iter_mut().zip(&texts) {
            convention.output = None;
            let image = text.parse().map_err(|problem: String| self.error(problem))?;
            convention.image = Some(image);
        }
        let conventions = conventions.each_ref();
        let Some(Trials { probes, .. }) = self.trials(dark, conventions, ranges)? else {
            return Ok(Vec::new());
        };
        let mut trials = Vec::new();
        for (((probe, convention), text), (_, kind)) in probes.into_iter().zip(conventions).zip(texts).zip(EXPRESSIONS)
        {
            let Probe { pairs, .. } = probe;
            for mut pair in pairs {
                if pair.is_clean() {
                    pair.endpoints = self.endpoints(convention, pair.ranges)?;
                }
                let text = text.clone();
                trials.push(ExpressionTrial { text, kind, pair });
            }
        }
        Ok(trials)
    }

    /// Sentence with the sidecar lines of the expressions that give plausible images; `None` if no expression does.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(super) fn better_expression(&self, dark: &[Rgb], flaw: Flaw) -> Result<Option<String>> {
        let mut found = self.expression_trials(dark)?;
        found.retain(|trial| trial.pair.is_clean() && trial.pair.is_near());
        found.sort_by(|a, b| a.pair.distance().total_cmp(&b.pair.distance()));
        let lines: Vec<String> =
            found.iter().map(|trial| format!("`image = \"{}\"` (if it is {})", trial.text, trial.kind)).collect();
        Ok((!lines.is_empty()).then(|| {
            format!(
                "Its output may not be the image itself; {ADD} the line that the model's code uses: {}{}",
                lines.join(" or "),
                if flaw == Flaw::Grey { "; if it is the enhanced luma, export it joined with the colours" } else { "" }
            )
        }))
    }

    /// Kind of the output, judged by its values for black and white in these ranges; `None` if it may be the image.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(super) fn kind_by_endpoints(&self, ranges: RangePair) -> Result<Option<OutputKind>> {
        if !self.reads_plain_image() {
            return Ok(None);
        }
        let endpoints = self.endpoints(self.convention(), ranges)?;
        Ok(endpoints.and_then(OutputKind::from_endpoints))
    }

    /// Caveat about an output that is not an image, judged by its values for black and white; `None` if it may be one.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(super) fn remark_on_endpoints(&self, ranges: RangePair) -> Result<Option<String>> {
        let Some(kind) = self.kind_by_endpoints(ranges)? else {
            return Ok(None);
        };
        let name = expression_name(&self.graph().signature.outputs[0].port.name);
        Ok(Some(match kind {
            OutputKind::Residual => format!(
                "its output is nearly black for a white image, like a residual; if the model's code adds it, {ADD}: `image = \"input + {name}\"`; `darkqa-eval enhance doctor` shows both"
            ),
            OutputKind::Map => format!(
                "its output is nearly as bright for black as for white, like a light map; if the model's code divides by it, {ADD}: `{}`; `darkqa-eval enhance doctor` shows both",
                light_map_line(&name)
            ),
        }))
    }

    /// Caveat about an output that is read as the image but named like a map or a residual; `None` for other names.
    pub(super) fn remark_on_name(&self) -> Option<String> {
        if !self.reads_plain_image() || self.convention().output.is_some() {
            return None;
        }
        let name = &self.graph().signature.outputs[0].port.name;
        let lower_case = name.to_lowercase();
        NAMES.iter().find(|word| lower_case.contains(**word))?;
        let term = expression_name(name);
        Some(format!(
            "its output {name:?} is named like a map or a residual, but read as the image; {ADD} what the model's code does: `{}`, `image = \"input + {term}\"` or `output = {name:?}`",
            light_map_line(&term)
        ))
    }

    /// True if all channels of one output are read as the image, without an expression.
    fn reads_plain_image(&self) -> bool {
        let convention = self.convention();
        convention.image.is_none()
            && convention.channels != Some(Channels::Y)
            && self.graph().signature.outputs[0].slice.is_none()
    }
}
