//! [`RunGroup`]: runs in a report that use the same images.

use std::fmt;
use std::sync::Arc;

/// The runs in a report whose images of a condition are equal, if other runs in the report have other images under the
/// same condition.
///
/// It is never stored: only a report on several runs sets it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunGroup {
    /// The name of the first of the runs, which the tables show.
    name: Arc<str>,
    /// The numbers of the runs in the report.
    runs: Arc<[usize]>,
}

impl RunGroup {
    /// The group of these runs; the tables show `name`.
    #[must_use]
    pub fn new(name: &str, runs: &[usize]) -> Self {
        Self { name: name.into(), runs: runs.into() }
    }

    /// The name that the tables show.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// True if two groups have a run in common; `None` means all runs.
    #[must_use]
    pub fn overlap(one: Option<&Self>, other: Option<&Self>) -> bool {
        one.zip(other).is_none_or(|(one, other)| one.runs.iter().any(|run| other.runs.contains(run)))
    }
}

/// Writes the suffix of conditions and variants, ` @RUN`.
impl fmt::Display for RunGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " @{}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_with_a_common_run_overlap() {
        let [one, two, both] = [&[0][..], &[1], &[0, 1]].map(|runs| RunGroup::new("a", runs));
        assert!(!RunGroup::overlap(Some(&one), Some(&two)));
        assert!(RunGroup::overlap(Some(&one), Some(&both)));
        assert!(RunGroup::overlap(None, Some(&two)));
        assert_eq!(format!("L3-noise{one}"), "L3-noise @a");
    }
}
