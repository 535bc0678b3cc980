//! Properties of an enhancer that its probe and its examination read.

use std::path::{Path, PathBuf};

use super::Enhancer;
use crate::convention::{Channels, ElementType, ValueRange, ValueScale};
use crate::graph::{Graph, RunResult};
use crate::planes::Planes;
use crate::probe::RangePair;
use crate::sidecar::{self, ModelSidecar};
use crate::size_search::TakenSizes;
use crate::usage::Usage;
use darkqa_ground::error::Result;
use darkqa_ground::types::enhancer_note::{ProbeNote, ProbeOutcome};
use darkqa_ground::types::{Rgb, SizeLog};

/// Largest mean, of 0..1, of an output of a white image that counts as a residual; chosen: models that give the image have more than 0.9.
const MOST_RESIDUAL: f64 = 0.25;

impl Enhancer {
    /// Path of the model's file; for an enhancer of the program, what messages call it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the model's sidecar, which may not be there.
    pub fn sidecar_path(&self) -> PathBuf {
        sidecar::path_for(&self.path)
    }

    /// Handle to the enhancer's counters.
    #[must_use]
    pub fn usage(&self) -> Usage {
        self.usage.clone()
    }

    /// The same enhancer with another note, which it goes on with.
    pub(crate) fn with_usage(self, usage: Usage) -> Self {
        let enhancer = Self { usage, ..self };
        enhancer.note_convention();
        enhancer
    }

    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Statements of sidecar and preset.
    pub(crate) fn convention(&self) -> &ModelSidecar {
        &self.graph.convention
    }

    /// The ranges in which it is fed and read now.
    pub(crate) fn ranges(&self) -> RangePair {
        RangePair {
            input: ValueScale::Range(self.graph.feeding.range),
            output: ValueScale::Range(self.graph.reading.range()),
        }
    }

    /// The ranges of input and output that the sidecar, a preset or the element types state. A preset that states none stands for
    /// 0..1, which all authors of presets use, and so does a sidecar with an expression, which is of values in 0..1.
    pub(crate) fn stated_ranges(&self) -> [Option<ValueRange>; 2] {
        let (signature, convention) = (&self.graph.signature, self.convention());
        let of = |stated: Option<ValueRange>, element: &ElementType| {
            let is_preset = self.description.preset.is_some();
            let is_composed = convention.input.is_some() || convention.image.is_some();
            let implied = (is_preset || is_composed).then_some(ValueRange::Unit);
            stated.or(element.certain_range()).or(implied)
        };
        // A small mean and deviation are of values in 0..1, those of other libraries of 0..255.
        let unit = |numbers: [Option<[f32; 3]>; 2]| {
            let mut numbers = numbers.into_iter().flatten().flatten().peekable();
            let is_stated = numbers.peek().is_some();
            (is_stated && numbers.all(|number| number.abs() <= 2.0)).then_some(ValueRange::Unit)
        };
        let normalised_in = unit([convention.mean, convention.std]);
        let normalised_out = unit([convention.mean_out, convention.std_out]);
        let [input, output] = [
            convention.range_in.or(normalised_in),
            convention.range_out.or(normalised_out),
        ];
        // Authors who normalise the input and do not document the output return 0..1.
        let output = output.or(normalised_in);
        [
            of(input, &signature.input.port.element),
            of(output, &signature.outputs[0].port.element),
        ]
    }

    /// True if a preset defines input and output, and no sidecar overrides it.
    pub(crate) fn follows_preset(&self) -> bool {
        let sidecar = &self.description.sidecar;
        let is_stated = sidecar.range_in.is_some() || sidecar.range_out.is_some();
        self.description.preset.is_some() && !is_stated && sidecar.color_out.is_none()
    }

    /// Whether the input may have a mean and a deviation that nothing states.
    pub(crate) fn may_be_normalised(&self, range_in: Option<ValueRange>) -> bool {
        let convention = self.convention();
        let stated = [
            convention.mean,
            convention.std,
            convention.mean_out,
            convention.std_out,
        ];
        range_in.is_none()
            && stated.iter().all(Option::is_none)
            && convention.channels.unwrap_or_default() == Channels::Rgb
    }

    /// Adds what a reader of the results must know, as it follows the model's name.
    pub(crate) fn remark(&mut self, words: &str) {
        let words = sidecar::named(words, &self.path);
        if !self.description.remarks.contains(&words) {
            self.description.remarks.push(words);
        }
        self.note_convention();
    }

    /// Takes what an earlier trial found that a reader of the results must know.
    pub(crate) fn set_remarks(&mut self, remarks: &[String]) {
        self.description.remarks = remarks.to_vec();
        self.note_convention();
    }

    /// Prints what a reader of the results must know.
    pub(crate) fn warn_of_remarks(&self) {
        for remark in &self.description.remarks {
            tracing::warn!("{}: {remark}", self.name);
        }
    }

    /// Whether its output of a white image, in these ranges, is so dark that it seems to have to be added to the input.
    ///
    /// # Errors
    /// If the runtime fails.
    pub(crate) fn may_be_residual(&self, ranges: RangePair) -> Result<bool> {
        let convention = self.convention();
        let (output, is_read) = (&self.graph.signature.outputs[0], convention.image.is_some());
        if is_read || output.slice.is_some() || convention.channels == Some(Channels::Y) {
            return Ok(false);
        }
        let convention = convention.clone().fed(ranges.input).read(ranges.output);
        let graph = self.graph.with_convention(convention);
        let graph = graph.map_err(|problem| self.fault(problem))?;
        let [height, width] = self.probe_size([96, 144]);
        let mut white = Rgb::black(height, width);
        white.samples_mut().fill(u8::MAX);
        graph.restart_clock();
        Ok(match graph.planes(&Planes::from_rgb(&white))? {
            RunResult::Output(planes) => {
                let sum: f64 = planes.samples.iter().map(|sample| f64::from(*sample)).sum();
                sum / planes.samples.len().max(1) as f64 <= MOST_RESIDUAL
            }
            _ => false,
        })
    }

    /// Height and width of a frame of the probe: the given ones, in the model's multiples, or those that it fixes.
    pub(crate) fn probe_size(&self, size: [usize; 2]) -> [usize; 2] {
        let mut rule = self.rule(size);
        if let Some(TakenSizes::Multiple(multiple)) = self.search.found() {
            rule.multiple = multiple;
        }
        rule.whole(size)
    }

    /// Resets the counts of size adaptations.
    pub fn count_anew(&mut self) {
        self.log = SizeLog::default();
        self.usage.set_sizes(self.twin, &self.log);
        self.usage.count_stored_anew();
    }

    /// Sizes that were found by trial.
    pub(crate) fn found_sizes(&self) -> Option<TakenSizes> {
        self.search.found()
    }

    /// Stores the result of the probe. The model is then used with the ranges that were tried, and no value counts as out of range.
    ///
    /// # Errors
    /// If the graph contradicts its own convention, which is a bug.
    pub(crate) fn set_probed(&mut self, probe: ProbeNote) -> Result<()> {
        let is_stated = self.stated_ranges().iter().all(Option::is_some);
        let ranges = self.ranges();
        let convention = self.convention().clone();
        let convention = convention.fed(ranges.input).read(ranges.output);
        let graph = self.graph.with_convention(convention);
        self.graph = graph.map_err(|problem| self.fault(problem))?;
        self.description.assumed |= !is_stated && probe.outcome == ProbeOutcome::Plausible;
        self.usage.update(|note| note.probe = Some(probe));
        self.note_convention();
        Ok(())
    }

    /// Notes how the model is fed and read, with the source of each value.
    pub(super) fn note_convention(&self) {
        let lines = self.description.lines(&self.graph, self.convention());
        let remarks = &self.description.remarks;
        self.usage.update(|note| {
            note.convention = lines;
            note.remarks.clone_from(remarks);
        });
    }
}
