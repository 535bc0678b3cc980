//! Examination of a model with an unknown convention: [`Enhancer::examine`].
//!
//! The model runs on a few dark frames with each possible convention. If exactly one convention gives plausible images,
//! it is proposed.
//!
//! Conclusion of an examination: proposed lines of a sidecar ([`Proposal`]).
//!
//! Trials of expressions for outputs that are not the image itself: residuals, gains and light maps.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::plausible::{Facts, UnclampedImage};
use super::probe::{Conclusion, OutputEnds, PairTrial, Probe, RangePair};
use super::probe_run::{ProbeTrials, run_frames};
use crate::conventions::sidecar::{self, ADD, ModelSidecar, OutputChoice};
use crate::conventions::{ChannelOrder, Channels, ValueRange, ValueScale};
use crate::enhancer::Enhancer;
use crate::graphs::Port;
use crate::outputs::{expression_name, light_map_line};
use crate::sizing::AcceptedSizes;
use darkqa_base::error::Result;
use darkqa_base::types::{Flaw, Rgb};

/// Results of a model on dark frames, by convention.
#[derive(Debug)]
pub struct Examination {
    /// The dark frames, in the size in which they are fed.
    pub frames: Vec<Rgb>,
    /// Conventions to draw, each with its images.
    pub columns: Vec<ExaminedConvention>,
    /// Proposed lines of a sidecar.
    pub proposal: Vec<ProposedLine>,
    /// Reason for the proposal, or for its absence.
    pub conclusion: String,
    /// How the sizes of the frames were handled, or why the model failed; empty if the proposal changes that.
    pub sizes: String,
    /// Whether exactly one convention is plausible and the model takes the frames.
    pub settled: Settled,
}

/// Whether it is known which output is the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageOutput {
    /// One output is the image.
    Known,
    /// Several outputs could be the image; the first one is read.
    Unknown,
}

/// Images of a model in one convention.
#[derive(Debug)]
pub struct ExaminedConvention {
    /// Heading that describes the convention.
    pub title: String,
    /// Output of the model for each frame.
    pub images: Vec<ExaminedImage>,
    /// Flaw of at least half of the images; `None` if they are plausible.
    pub problem: Option<String>,
}

/// One image of a model.
#[derive(Debug)]
pub struct ExaminedImage {
    /// The image, clamped and rounded.
    pub image: Rgb,
    /// Statistics of the image before clamping.
    pub facts: Facts,
    /// Flaw of the image; `None` if it is plausible.
    pub problem: Option<String>,
}

impl Enhancer {
    /// Runs the model on dark frames in each possible convention.
    ///
    /// # Errors
    /// If the model accepts neither the frames nor any size of the probe.
    pub fn examine(&mut self, dark: &[Rgb], image: ImageOutput) -> Result<Examination> {
        let sizes = self.try_sizes(dark);
        let order = self.other_order();
        let Some(trials) = self.trials_of_all(dark)? else {
            // A failure on the frames themselves has its own remedy.
            sizes?;
            return Err(self.error(format!(
                "fails at 144 × 96, 160 × 120 and 128 × 128; {ADD} the sizes that it takes: `multiple = N` or `fixed = [WIDTH, HEIGHT]`"
            )));
        };
        let ProbeTrials { frames, probes: [probe, swapped] } = trials;
        let mut others = self.other_outputs(&frames, probe.best())?;
        let plausible: Vec<String> =
            others.iter().filter(|output| output.problem.is_none()).map(|output| output.title.clone()).collect();
        let stated = self.stated_pair();
        let mut found = match (image, stated) {
            (ImageOutput::Unknown, _) => Proposal::for_unknown_output(&self.output_title(), &probe, &plausible),
            (ImageOutput::Known, Some(pair)) if probe.plausible().contains(&pair) => Proposal::for_stated(pair),
            (ImageOutput::Known, _) => propose(&probe, stated, &swapped, order),
        };
        if !found.lines.is_empty() {
            found.lines.extend(self.found_size());
        }
        if image == ImageOutput::Known {
            found.mention_outputs(&plausible);
            let kind = self.kind_by_endpoints(probe.best())?;
            if kind.is_some() || found.lines.is_empty() && probe.plausible().is_empty() {
                let expressions = self.expressions(dark)?;
                if !expressions.is_empty() {
                    found.settled = Settled::No;
                    found.conclusion += match kind {
                        Some(OutputKind::Residual) => {
                            " Its output is nearly black for a white image, like a residual; the page shows the expressions that may be the image."
                        }
                        Some(OutputKind::Map) => {
                            " Its output is nearly as bright for a black image as for a white one, like a light map; the page shows the expressions that may be the image."
                        }
                        None => " The image may be made of input and output; the page shows the plausible expressions.",
                    };
                }
                others.extend(expressions);
            }
        }
        let sizes = match sizes {
            Ok(summary) => summary,
            Err(problem) if probe.plausible().contains(&probe.usual) => {
                found.settled = Settled::No;
                let _ = write!(found.conclusion, " But not all images can be enhanced: {problem}");
                problem.to_string()
            }
            // Caused by the present ranges, which the proposal replaces.
            Err(_) if !found.lines.is_empty() => String::new(),
            Err(problem) => problem.to_string(),
        };
        let convention = self.convention();
        let is_stated = convention.color.is_some()
            || convention.color_out.is_some()
            || self.stated_ranges().iter().any(Option::is_some);
        let as_stated = is_stated.then_some(probe.usual);
        let output = match image {
            ImageOutput::Known => String::new(),
            ImageOutput::Unknown => self.output_title() + ", ",
        };
        let columns = conventions_to_draw(&output, &probe, as_stated, &swapped, order, others);
        Ok(Examination {
            settled: found.settled,
            frames,
            columns,
            proposal: found.lines,
            conclusion: sidecar::insert_sidecar_name(&found.conclusion, self.path()),
            sizes,
        })
    }

    /// Channel order of the output that is not the present one.
    fn other_order(&self) -> ChannelOrder {
        let stated = self.convention();
        swapped(stated.color_out.or(stated.color).unwrap_or_default())
    }

    /// Runs the model on dark frames with all value ranges, in the present channel order of the output and in the
    /// other.
    fn trials_of_all(&self, dark: &[Rgb]) -> Result<Option<ProbeTrials<2>>> {
        let stated = self.convention().clone();
        let swapped = ModelSidecar { color_out: Some(self.other_order()), ..stated.clone() };
        self.trials(dark, [&stated, &swapped], [None; 2])
    }

    /// Sentence with the only sidecar lines that make the images of dark frames plausible; `None` if no or several sets
    /// of lines do.
    pub(super) fn better_lines(&self, dark: &[Rgb]) -> Result<Option<String>> {
        let Some(trials) = self.trials_of_all(dark)? else {
            return Ok(None);
        };
        let [mut probe, mut swapped] = trials.probes;
        // A pair is advised only if all frames are plausible with it.
        for probe in [&mut probe, &mut swapped] {
            probe.leave_out_mixed();
        }
        let found = propose(&probe, self.stated_pair(), &swapped, self.other_order());
        let lines: Vec<String> = found.lines.iter().map(|line| format!("`{}`", line.line)).collect();
        Ok((!lines.is_empty()).then(|| {
            format!(
                "{} If the model's code does that, {ADD}, replacing the present values: {}",
                found.conclusion,
                lines.join(" and ")
            )
        }))
    }

    /// Title that names the output that is read.
    fn output_title(&self) -> String {
        format!("output {:?}", self.graph().signature.outputs[0].port.name)
    }

    /// The stated ranges of input and output; `None` if one of them is not stated.
    fn stated_pair(&self) -> Option<RangePair> {
        let [input, output] = self.stated_ranges();
        Some(RangePair { input: ValueScale::Range(input?), output: ValueScale::Range(output?) })
    }

    /// Runs the model on one frame of each size, to find the sizes that it accepts. Returns a summary of the sizes.
    fn try_sizes(&mut self, frames: &[Rgb]) -> Result<String> {
        let mut tried = BTreeSet::new();
        for frame in frames {
            if tried.insert([frame.height(), frame.width()]) {
                self.enhance(frame)?;
            }
        }
        Ok(self.usage().note().sizes)
    }

    /// Sidecar line for the accepted sizes, if they were found by trial.
    fn found_size(&self) -> Option<ProposedLine> {
        let line = match self.found_sizes()? {
            AcceptedSizes::Multiple(multiple) => format!("multiple = {multiple}"),
            AcceptedSizes::Traced([height, width]) => format!("fixed = [{width}, {height}]"),
        };
        let reason = "found by trial: it fails at other sizes".to_owned();
        Some(ProposedLine { line, reason })
    }

    /// Expressions of input and output that give plausible images.
    fn expressions(&self, dark: &[Rgb]) -> Result<Vec<ExaminedConvention>> {
        let trials = self.expression_trials(dark)?;
        Ok(trials
            .into_iter()
            .filter(|trial| trial.pair.is_clean())
            .map(|ExpressionTrial { text, pair, .. }| column(&pair, format!("image = \"{text}\", {}", pair.ranges)))
            .collect())
    }

    /// Images of the outputs that are not read.
    fn other_outputs(&self, frames: &[Rgb], ranges: RangePair) -> Result<Vec<ExaminedConvention>> {
        let seen: Vec<UnclampedImage> = frames.iter().map(UnclampedImage::from_rgb).collect();
        let mut columns = Vec::new();
        for Port { name, .. } in &self.graph().signature.unread {
            let convention = ModelSidecar {
                output: Some(OutputChoice::Name(name.clone())),
                image: None,
                ..self.convention().clone()
            };
            let convention = convention.with_input_scale(ranges.input).with_output_scale(ranges.output);
            // Outputs that cannot be an image, such as curves, are left out.
            let Ok(graph) = self.graph().with_convention(convention) else {
                continue;
            };
            let made = run_frames(&[graph], frames)?;
            if let Some(made) = made.and_then(|mut made| made.pop()) {
                let pair = PairTrial::new(ranges, &seen, made);
                columns.push(column(&pair, format!("output {name:?}, {ranges}")));
            }
        }
        Ok(columns)
    }
}

fn swapped(order: ChannelOrder) -> ChannelOrder {
    match order {
        ChannelOrder::Rgb => ChannelOrder::Bgr,
        ChannelOrder::Bgr => ChannelOrder::Rgb,
    }
}

/// Conventions to draw: the plausible ones and the one that a run would use (`stated`), or all if none is plausible.
/// `output` is a prefix of the titles that names the output.
fn conventions_to_draw(
    output: &str,
    probe: &Probe,
    stated: Option<RangePair>,
    swapped: &Probe,
    order: ChannelOrder,
    others: Vec<ExaminedConvention>,
) -> Vec<ExaminedConvention> {
    let stated_title = stated.map(|pair| format!("{output}{pair}, as set"));
    let mut shown = columns(probe, |ranges| match &stated_title {
        Some(title) if stated == Some(ranges) => title.clone(),
        _ => format!("{output}{ranges}"),
    });
    let swapped = columns(swapped, |ranges| format!("{output}{ranges}, {order} in the output"));
    // Implausible images in the other channel order would only distract.
    shown.extend(swapped.into_iter().filter(|column| column.problem.is_none()));
    shown.extend(others);
    if shown.iter().any(|column| column.problem.is_none()) {
        shown.retain(|column| column.problem.is_none() || stated_title.as_ref() == Some(&column.title));
    }
    shown
}

fn columns(probe: &Probe, title: impl Fn(RangePair) -> String) -> Vec<ExaminedConvention> {
    probe.pairs.iter().map(|pair| column(pair, title(pair.ranges))).collect()
}

fn column(pair: &PairTrial, title: String) -> ExaminedConvention {
    ExaminedConvention {
        title,
        images: pair
            .made
            .iter()
            .zip(&pair.verdicts)
            .map(|(output, verdict)| ExaminedImage {
                image: output.to_rgb(),
                facts: output.facts(),
                problem: verdict.map(|verdict| verdict.to_string()),
            })
            .collect(),
        problem: pair.verdict().map(|verdict| verdict.to_string()),
    }
}

/// Whether an examination found one convention.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Settled {
    /// Exactly one convention is plausible.
    Yes,
    /// No or several conventions are plausible.
    No,
}

/// A proposed line of a sidecar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProposedLine {
    /// The line, such as `range_in = "0..1"`.
    pub line: String,
    /// Reason for the proposal.
    pub reason: String,
}

/// Conclusion of an examination, with proposed lines.
pub(super) struct Proposal {
    lines: Vec<ProposedLine>,
    conclusion: String,
    settled: Settled,
}

impl Proposal {
    fn without_lines(conclusion: String) -> Self {
        Self { lines: Vec::new(), conclusion, settled: Settled::No }
    }

    /// No lines, because the stated ranges are plausible.
    fn for_stated(pair: RangePair) -> Self {
        let conclusion = format!(
            "With {pair}, as set by MODEL.onnx.toml, the preset or the element types, its images are plausible."
        );
        Self { settled: Settled::Yes, ..Self::without_lines(conclusion) }
    }

    /// No lines, because several outputs could be the image: `first`, which is read, and `others`, which are plausible.
    fn for_unknown_output(first: &str, probe: &Probe, others: &[String]) -> Self {
        let mut plausible: Vec<&str> = Vec::new();
        if !probe.plausible().is_empty() {
            plausible.push(first);
        }
        plausible.extend(others.iter().map(String::as_str));
        Self::without_lines(format!(
            "It is unknown which output is the image; plausible: {}. Choose one in MODEL.onnx.toml next to it, `output = \"NAME\"`, or name its preset (PRESET:FILE).",
            if plausible.is_empty() { "none".to_owned() } else { plausible.join("; ") }
        ))
    }

    /// Adds to the conclusion that other outputs give plausible images, too.
    fn mention_outputs(&mut self, others: &[String]) {
        for output in others {
            let found = " gives plausible images, too; check which one the model's code uses.";
            self.conclusion += &[" The ", output, found].concat();
        }
    }

    /// Lines that state a pair of ranges.
    fn for_ranges(pair: RangePair, conclusion: String) -> Self {
        let reason = "with these value ranges its images are plausible";
        let lines = pair.lines().into_iter().map(|line| ProposedLine { line, reason: reason.to_owned() });
        Self { lines: lines.collect(), conclusion, settled: Settled::Yes }
    }
}

/// Proposes the only plausible pair of ranges. `swapped` is the probe with the output in the other channel order,
/// `order`. It is used if no pair is plausible in the present order and swapped colours are the flaw; if several of its
/// pairs are plausible, the `stated` one is proposed.
fn propose(probe: &Probe, stated: Option<RangePair>, swapped: &Probe, order: ChannelOrder) -> Proposal {
    match probe.plausible().as_slice() {
        several @ [_, _, ..] if stated.is_none() && probe.conclusion() == Conclusion::Assumed => {
            let others: Vec<String> =
                several.iter().filter(|pair| **pair != probe.usual).map(ToString::to_string).collect();
            return Proposal::without_lines(format!(
                "With {} its images are plausible; a run assumes these usual ranges and warns. They are with {}, too; compare the page with the model's own examples.",
                probe.usual,
                others.join("; ")
            ));
        }
        [pair] => {
            let stated = stated.map_or_else(String::new, |stated| format!(" With {stated}, as set, they are not."));
            let conclusion = format!("With {pair}, and with no other ranges, its images are plausible.{stated}");
            return Proposal::for_ranges(*pair, conclusion);
        }
        [] => {}
        several => {
            let list: Vec<String> = several.iter().map(ToString::to_string).collect();
            if let Some(pair) = probe.likeliest() {
                let conclusion = format!(
                    "With {pair} its images are plausible, and black and white change least. Other plausible ranges: {}.",
                    list[1..].join("; ")
                );
                return Proposal::for_ranges(pair, conclusion);
            }
            let stated = stated.map_or_else(String::new, |pair| format!(" {pair}, as set, is not one of them."));
            return Proposal::without_lines(format!(
                "Its images are plausible with several value ranges: {}.{stated} Compare the page with the model's own examples, and set the ranges of its code.",
                list.join("; ")
            ));
        }
    }
    let is_hue = probe.pairs.iter().any(|pair| {
        pair.ranges == probe.usual && pair.verdict().is_some_and(|verdict| verdict.example.flaw == Flaw::Hue)
    });
    let plausible = swapped.plausible();
    let pair = match &plausible[..] {
        [pair] => Some(*pair),
        several => stated.filter(|pair| several.contains(pair)),
    };
    if let Some(pair) = pair.filter(|_| is_hue) {
        let order_of_input = order.to_string().to_lowercase();
        let conclusion = format!(
            "With {pair} and {order} in the output its images are plausible; or with it in the input: `color = \"{order_of_input}\"` and the other order for `color_out`."
        );
        let mut found = Proposal::for_ranges(pair, conclusion);
        if stated == Some(pair) {
            found.lines.clear();
        }
        found.lines.push(ProposedLine {
            line: format!("color_out = \"{}\"", order.to_string().to_lowercase()),
            reason: "with the other order, its images are blue where the frames are red".to_owned(),
        });
        return found;
    }
    Proposal::without_lines(
        "No value range or colour order gives plausible images. Perhaps it needs the `mean` and `std`, or `mean_out` and `std_out`, of its code, another output is the image, the dimensions have another order, or the export has lost its weights.".to_owned(),
    )
}

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
    fn from_endpoints(endpoints: OutputEnds) -> Option<Self> {
        let OutputEnds { black, white, .. } = endpoints;
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
        let Some(ProbeTrials { probes, .. }) = self.trials(dark, conventions, ranges)? else {
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
