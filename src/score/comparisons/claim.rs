//! Statement that a finding supports: [`Claim`].

use crate::significance::{ALPHA, Verdict};

/// Statement that the sentences of a report may make about a finding that was tested in both parsings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// Detected after the correction over all sentences, in both parsings and in the same direction.
    Detected(Verdict),
    /// Detected after that correction in the strict parsing only, with this direction.
    StrictOnly(Verdict),
    /// Detected only by the correction within its own set of tests.
    InOwnSet,
    /// The missing replies decide whether a difference is detected.
    Missing,
    /// Not detected.
    Open,
    /// No verdict is possible with so few clusters or items.
    Impossible,
}

/// A finding in one parsing of the replies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ParsedFinding {
    /// Gain of the first side over the second.
    pub(super) gain: f64,
    /// Verdict within its own set of tests.
    pub(super) verdict: Verdict,
    /// p-value after the correction over all sentences; `None` if no sentence is about the finding.
    pub(super) p_report: Option<f64>,
}

impl ParsedFinding {
    fn is_detected(&self) -> bool {
        self.p_report.is_some_and(|value| value < ALPHA)
    }

    fn direction(&self) -> Verdict {
        if self.gain > 0.0 { Verdict::Better } else { Verdict::Worse }
    }
}

impl Claim {
    /// Verdict of a finding in tables, which is that of the sentences. `own` is its verdict within its own set of
    /// tests, and `p_report` its p-value after the correction over all sentences. `None` if no sentence is about the
    /// finding.
    pub(super) fn verdict(self, own: Verdict, p_report: Option<f64>) -> Option<Verdict> {
        match self {
            _ if !own.is_possible() => Some(own),
            _ if p_report.is_none() => None,
            Self::Detected(verdict) => Some(verdict),
            Self::Missing => Some(Verdict::Missing),
            _ => Some(Verdict::NotShown),
        }
    }

    /// Derives the claim from both parsings of a finding.
    pub(super) fn new(strict: ParsedFinding, lenient: ParsedFinding) -> Self {
        let is_same_direction = strict.gain * lenient.gain > 0.0;
        if !strict.verdict.is_possible() {
            Self::Impossible
        } else if strict.is_detected() && lenient.is_detected() && is_same_direction {
            Self::Detected(strict.direction())
        } else if strict.is_detected() {
            Self::StrictOnly(strict.direction())
        } else if strict.verdict.is_shown() {
            Self::InOwnSet
        } else if strict.verdict == Verdict::Missing {
            Self::Missing
        } else {
            Self::Open
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(gain: f64, p: f64) -> ParsedFinding {
        ParsedFinding { gain, verdict: Verdict::Worse, p_report: Some(p) }
    }

    #[test]
    fn detection_needs_both_parsings_in_one_direction() {
        for (strict, lenient, expected) in [
            ((-0.2, 0.01), (-0.1, 0.01), Claim::Detected(Verdict::Worse)),
            ((-0.2, 0.01), (-0.1, 0.2), Claim::StrictOnly(Verdict::Worse)),
            ((0.2, 0.01), (-0.1, 0.01), Claim::StrictOnly(Verdict::Better)),
            ((-0.2, 0.05), (-0.1, 0.01), Claim::InOwnSet),
        ] {
            let claim = Claim::new(finding(strict.0, strict.1), finding(lenient.0, lenient.1));
            assert_eq!(claim, expected);
        }
        let unshown = ParsedFinding { verdict: Verdict::NotShown, p_report: None, ..finding(-0.2, 0.5) };
        assert_eq!(Claim::new(unshown, unshown), Claim::Open);
        let few = ParsedFinding { verdict: Verdict::TooFewClusters, ..finding(-0.2, 0.001) };
        assert_eq!(Claim::new(few, few), Claim::Impossible);
    }
}
