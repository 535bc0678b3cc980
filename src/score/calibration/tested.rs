//! Difference between confidence and accuracy, with its test: [`TestedConfidence`].

use crate::comparisons::paired::tested_difference;
use crate::estimate::Estimate;
use crate::significance::ALPHA;

/// Mean of confidence minus accuracy, or of its change, with the test against 0 by Student's t that matches its
/// interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestedConfidence {
    pub estimate: Estimate,
    /// p-value of a mean of 0.
    pub p: f64,
    /// p-value after the correction over all tests behind sentences; `None` if no sentence is about it.
    pub p_report: Option<f64>,
}

impl TestedConfidence {
    /// Tests the mean of numbers, each given with its cluster; `None` without numbers.
    pub(super) fn new(clusters: usize, numbers: impl Iterator<Item = (u32, f64)>) -> Option<Self> {
        let mut sums = vec![(0.0, 0.0); clusters];
        let (mut squares, mut n) = (0.0, 0);
        for (cluster, number) in numbers {
            let (sum, count) = &mut sums[cluster as usize];
            *sum += number;
            *count += 1.0;
            squares += number * number;
            n += 1;
        }
        sums.retain(|(_, count)| *count > 0.0);
        (n > 0).then(|| {
            let (estimate, p) = tested_difference(&sums, squares, n);
            Self { estimate, p, p_report: None }
        })
    }

    /// True if the mean is shown to be above 0 after the correction over all sentences.
    #[must_use]
    pub fn is_above(&self) -> bool {
        self.estimate.value > 0.0 && self.p_report.is_some_and(|value| value < ALPHA)
    }
}
