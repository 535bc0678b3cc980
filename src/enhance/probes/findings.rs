//! Results of opening and probing an enhancer, to be stored and reused: [`Findings`].

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::usage::{Implausible, Usage};
use crate::enhancer::Enhancer;
use crate::sizing::AcceptedSizes;
use darkqa_base::error::Result;
use darkqa_base::types::EnhancerName;
use darkqa_base::types::manifests::{ConventionLine, ProbeNote, ProbeOutcome};

/// Results of opening an enhancer and probing it on dark frames: the content of its usage record before the first
/// image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// Rows of the table of the model's input and output convention.
    convention: Vec<ConventionLine>,
    /// Result of the probe; `None` if the model accepts none of its sizes.
    probe: Option<ProbeNote>,
    /// Caveats for readers of the results.
    #[serde(default)]
    remarks: Vec<String>,
    /// Message about the accepted sizes, if they were found by trial.
    sizes: Option<String>,
}

impl Findings {
    /// True if a run with this reaction to implausible images may use the enhancer.
    pub fn allow(&self, implausible: Implausible) -> bool {
        let probe = self.probe.as_ref();
        let is_overruled = probe.is_some_and(|probe| probe.outcome == ProbeOutcome::Overruled);
        implausible != Implausible::Refused || !is_overruled
    }

    /// A usage record that starts with these findings.
    pub fn usage(&self) -> Usage {
        let usage = Usage::default();
        usage.update(|note| {
            note.convention.clone_from(&self.convention);
            note.probe.clone_from(&self.probe);
            note.remarks.clone_from(&self.remarks);
        });
        usage
    }

    /// Repeats the warnings of the probe.
    pub fn warn(&self, name: &EnhancerName, path: &Path) {
        if let Some(sizes) = &self.sizes {
            tracing::warn!("{}: {sizes}", path.display());
        }
        for remark in &self.remarks {
            tracing::warn!("{name}: {remark}");
        }
        match &self.probe {
            None => warn_not_probed(name),
            Some(probe) => {
                if let Some(problem) = &probe.problem {
                    tracing::warn!("{name}: {problem}");
                }
            }
        }
    }
}

/// Warns about a model that accepts none of the sizes of the probe.
pub(super) fn warn_not_probed(name: &EnhancerName) {
    tracing::warn!(
        "{name}: its images were not checked, because it fails at small sizes such as 144 × 96; look at some of them"
    );
}

impl Enhancer {
    /// Problem found by the probe, if the enhancer is used in spite of it; to be called after the probe.
    pub fn overruled_problem(&self) -> Option<String> {
        let probe = self.usage().note().probe?;
        let is_overruled = probe.outcome == ProbeOutcome::Overruled;
        probe.problem.filter(|_| is_overruled)
    }

    /// Results of opening and probing; to be called after the probe.
    pub fn findings(&self) -> Findings {
        let note = self.usage().note();
        Findings {
            convention: note.convention,
            probe: note.probe,
            remarks: note.remarks,
            sizes: self.found_sizes().map(AcceptedSizes::message),
        }
    }

    /// The enhancer with the findings of an earlier probe instead of a new one, and with a usage record that it
    /// continues.
    ///
    /// # Errors
    /// If the graph contradicts its own convention, which is a bug.
    pub fn with_findings(self, findings: &Findings, usage: Usage) -> Result<Self> {
        let mut enhancer = self.with_usage(usage);
        enhancer.set_remarks(&findings.remarks);
        if let Some(probe) = &findings.probe {
            enhancer.set_probe_result(probe.clone())?;
        }
        Ok(enhancer)
    }
}
