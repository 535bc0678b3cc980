//! What is known of an enhancer, for its probe and its examination.

use std::path::{Path, PathBuf};

use super::Enhancer;
use crate::convention::{ElementType, ValueRange};
use crate::graph::Graph;
use crate::probe::RangePair;
use crate::sidecar::{self, ModelSidecar};
use crate::size_search::TakenSizes;
use crate::usage::Usage;
use darkqa_ground::error::Result;
use darkqa_ground::types::SizeLog;
use darkqa_ground::types::enhancer_note::{ProbeNote, ProbeOutcome};

impl Enhancer {
    /// Path of the model's file; for an enhancer of the program, what messages call it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the model's sidecar, which may not be there.
    pub fn sidecar_path(&self) -> PathBuf {
        sidecar::path_for(&self.path)
    }

    /// A handle to what it did so far.
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

    /// What sidecar and preset state.
    pub(crate) fn convention(&self) -> &ModelSidecar {
        &self.graph.convention
    }

    /// The ranges in which it is fed and read now.
    pub(crate) fn ranges(&self) -> RangePair {
        RangePair {
            input: self.graph.feeding.range,
            output: self.graph.reading.range(),
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
        [
            of(convention.range_in, &signature.input.port.element),
            of(convention.range_out, &signature.outputs[0].port.element),
        ]
    }

    /// Height and width of a frame of the probe: the given ones, in the model's multiples, or those that it fixes.
    pub(crate) fn probe_size(&self, size: [usize; 2]) -> [usize; 2] {
        let mut rule = self.rule(size);
        if let Some(TakenSizes::Multiple(multiple)) = self.search.found() {
            rule.multiple = multiple;
        }
        rule.whole(size)
    }

    /// Counts from now on what is done because of sizes.
    pub fn count_anew(&mut self) {
        self.log = SizeLog::default();
        self.usage.set_sizes(self.twin, &self.log);
        self.usage.count_stored_anew();
    }

    /// Sizes that were found by trial.
    pub(crate) fn found_sizes(&self) -> Option<TakenSizes> {
        self.search.found()
    }

    /// Notes what the probe found. From now on it is fed and read in the ranges that were tried, and no value is out of range.
    ///
    /// # Errors
    /// If the graph contradicts its own convention, which is a bug.
    pub(crate) fn set_probed(&mut self, probe: ProbeNote) -> Result<()> {
        let ranges = self.ranges();
        let convention = ModelSidecar {
            range_in: Some(ranges.input),
            range_out: Some(ranges.output),
            ..self.convention().clone()
        };
        let graph = self.graph.with_convention(convention);
        self.graph = graph.map_err(|problem| self.fault(problem))?;
        self.description.probed = probe.outcome == ProbeOutcome::Plausible;
        self.usage.update(|note| note.probe = Some(probe));
        self.note_convention();
        Ok(())
    }

    /// Notes how the model is fed and read, with the source of each value.
    pub(super) fn note_convention(&self) {
        let lines = self.description.lines(&self.graph, self.convention());
        self.usage.update(|note| note.convention = lines);
    }
}
