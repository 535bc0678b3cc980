//! Examination of a model with an unknown convention: [`Enhancer::examine`].
//!
//! The model runs on a few dark frames with each possible convention. If exactly one convention gives plausible images,
//! it is proposed.

mod proposal;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::expressions::{ExpressionTrial, OutputKind};
use super::plausible::{Facts, UnclampedImage};
use super::probe::{PairTrial, Probe};
use super::probe_run::Trials;
use super::range_pair::RangePair;
use super::trial_images::run_frames;
use crate::conventions::sidecar::{self, ADD, ModelSidecar, OutputChoice};
use crate::conventions::{ChannelOrder, ValueScale};
use crate::enhancer::Enhancer;
use crate::graphs::Port;
use crate::sizing::AcceptedSizes;
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;
use proposal::{Proposal, propose};
pub use proposal::{ProposedLine, Settled};

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
        let Trials { frames, probes: [probe, swapped] } = trials;
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
    fn trials_of_all(&self, dark: &[Rgb]) -> Result<Option<Trials<2>>> {
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
