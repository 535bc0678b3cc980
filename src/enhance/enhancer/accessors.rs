//! Accessors of an enhancer for the probe and `enhance doctor`, and updates of its [`Usage`].

use std::path::{Path, PathBuf};

use super::Enhancer;
use crate::conventions::sidecar::{self, ModelSidecar};
use crate::conventions::{Channels, Normalisation, ValueRange, ValueScale};
use crate::graphs::Graph;
use crate::probes::{RangePair, Usage};
use crate::sizing::AcceptedSizes;
use darkqa_base::error::Result;
use darkqa_base::types::SizeLog;
use darkqa_base::types::manifests::{ProbeNote, ProbeOutcome};

impl Enhancer {
    /// Path of the model file; for a built-in enhancer, the name that messages show.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the model's sidecar, whether or not the file exists.
    pub fn sidecar_path(&self) -> PathBuf {
        sidecar::path_for(&self.path)
    }

    /// Handle to the enhancer's convention, caveats and counts, for manifests and reports.
    #[must_use]
    pub fn usage(&self) -> Usage {
        self.usage.clone()
    }

    /// Largest number of threads that work on one image.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// The enhancer with another usage record, into which it writes from now on.
    pub(crate) fn with_usage(self, usage: Usage) -> Self {
        let enhancer = Self { usage, ..self };
        enhancer.note_convention();
        enhancer
    }

    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Input and output convention from sidecar and preset.
    pub(crate) fn convention(&self) -> &ModelSidecar {
        &self.graph.convention
    }

    /// Value ranges in which the input is currently encoded and the output decoded.
    pub(crate) fn ranges(&self) -> RangePair {
        RangePair {
            input: ValueScale::Range(self.graph.encoding.range),
            output: ValueScale::Range(self.graph.decoding.range()),
        }
    }

    /// Value ranges of input and output, as far as the sidecar, a preset or the element types state them. A preset
    /// without a range means 0..1, which all authors of presets use. A sidecar with an expression also means 0..1,
    /// because expressions are defined on values in 0..1.
    pub(crate) fn stated_ranges(&self) -> [Option<ValueRange>; 2] {
        let (signature, convention) = (&self.graph.signature, self.convention());
        let normalised_in = range_of_normalisation([convention.mean, convention.std]);
        let normalised_out = range_of_normalisation([convention.mean_out, convention.std_out]);
        let range_in = convention.range_in.or(normalised_in);
        // Authors who normalise the input and do not document the output return 0..1.
        let range_out = convention.range_out.or(normalised_out).or(normalised_in);
        let has_expression = convention.input.is_some() || convention.image.is_some();
        let implied = (self.description.preset.is_some() || has_expression).then_some(ValueRange::Unit);
        [(range_in, &signature.input.port.element), (range_out, &signature.outputs[0].port.element)]
            .map(|(range, element)| range.or(element.implied_range()).or(implied))
    }

    /// True if a preset defines input and output, and the sidecar overrides neither a value range nor the channel order
    /// of the output.
    pub(crate) fn follows_preset(&self) -> bool {
        let sidecar = &self.description.sidecar;
        self.description.preset.is_some()
            && sidecar.range_in.is_none()
            && sidecar.range_out.is_none()
            && sidecar.color_out.is_none()
    }

    /// Scales of input and output to try: all, unless a range is given or the convention states a normalisation. Where
    /// the input's normalisation is stated, the output may have the same.
    pub(crate) fn scales_to_try(
        &self,
        range_in: Option<ValueRange>,
        range_out: Option<ValueRange>,
    ) -> [Vec<ValueScale>; 2] {
        let convention = self.convention();
        let ranges = self.ranges();
        let is_rgb = convention.channels.unwrap_or_default() == Channels::Rgb;
        let mean_and_std_in = convention.mean_and_std_in();
        let try_all = |range: Option<ValueRange>, is_stated: bool, stated: ValueScale| match range {
            None if is_rgb && !is_stated => ValueScale::ALL.to_vec(),
            None => vec![stated],
            Some(range) => vec![ValueScale::Range(range)],
        };
        let is_stated_out = convention.mean_and_std_out().is_some();
        let same = mean_and_std_in
            .map(|stated| ValueScale::Normalised(Normalisation::Stated(stated)))
            .filter(|_| ranges.input.range() == ValueRange::Unit);
        let stated_in = same.unwrap_or(ranges.input);
        let inputs = try_all(range_in, mean_and_std_in.is_some(), stated_in);
        let mut outputs = try_all(range_out, is_stated_out, ranges.output);
        let is_known = outputs.iter().any(|known| known.mean_and_std() == mean_and_std_in);
        if is_rgb && range_out.is_none() && !is_stated_out && !is_known {
            outputs.extend(same);
        }
        [inputs, outputs]
    }

    /// Adds a caveat for readers of the results: a sentence that follows the model's name.
    pub(crate) fn remark(&mut self, text: &str) {
        let text = sidecar::insert_sidecar_name(text, &self.path);
        if !self.description.remarks.contains(&text) {
            self.description.remarks.push(text);
        }
        self.note_convention();
    }

    /// Replaces the caveats for readers of the results, for example by those of an earlier probe.
    pub(crate) fn set_remarks(&mut self, remarks: &[String]) {
        self.description.remarks = remarks.to_vec();
        self.note_convention();
    }

    /// Logs the caveats for readers of the results as warnings.
    pub(crate) fn log_remarks(&self) {
        for remark in &self.description.remarks {
            tracing::warn!("{}: {remark}", self.name);
        }
    }

    /// Height and width of a probe frame: the given size padded to the model's multiple, or the model's fixed size.
    pub(crate) fn probe_size(&self, size: [usize; 2]) -> [usize; 2] {
        let mut rule = self.rule(size);
        if let Some(AcceptedSizes::Multiple(multiple)) = self.search.found() {
            rule.multiple = multiple;
        }
        rule.run_size(size)
    }

    /// Resets the counts of padded, tiled and resized images.
    pub fn reset_counts(&mut self) {
        self.log = SizeLog::default();
        self.usage.set_sizes(self.twin, &self.log);
        self.usage.reset_stored_counts();
    }

    /// Sizes that the model accepts, if they were found by trial.
    pub(crate) fn found_sizes(&self) -> Option<AcceptedSizes> {
        self.search.found()
    }

    /// Records the result of the probe, and writes the current value ranges into the convention as stated ones. Later
    /// output values outside these ranges are clamped without an error.
    ///
    /// # Errors
    /// If the graph contradicts its own convention, which is a bug.
    pub(crate) fn set_probe_result(&mut self, probe: ProbeNote) -> Result<()> {
        let is_stated = self.stated_ranges().iter().all(Option::is_some);
        let ranges = self.ranges();
        let convention = self.convention().clone();
        let convention = convention.with_input_scale(ranges.input).with_output_scale(ranges.output);
        self.graph = self.graph.with_convention(convention).map_err(|problem| self.error(problem))?;
        self.description.has_assumed_ranges |= !is_stated && probe.outcome == ProbeOutcome::Plausible;
        self.usage.update(|note| note.probe = Some(probe));
        self.note_convention();
        Ok(())
    }

    /// Copies the convention, with the source of each value, and the caveats into the usage record.
    pub(super) fn note_convention(&self) {
        let lines = self.description.lines(&self.graph, self.convention());
        let remarks = &self.description.remarks;
        self.usage.update(|note| {
            note.convention = lines;
            note.remarks.clone_from(remarks);
        });
    }
}

/// Value range to which a mean and a deviation refer: 0..1 if one is stated and no magnitude exceeds 2. Otherwise
/// unknown, because some libraries state them for 0..255.
fn range_of_normalisation(mean_and_std: [Option<[f32; 3]>; 2]) -> Option<ValueRange> {
    let mut numbers = mean_and_std.into_iter().flatten().flatten().peekable();
    let is_stated = numbers.peek().is_some();
    (is_stated && numbers.all(|number| number.abs() <= 2.0)).then_some(ValueRange::Unit)
}
