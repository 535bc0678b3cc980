//! Runs of a report that show the same images, if other runs show others under the same name: [`RunGroup`].

use std::fmt;
use std::sync::Arc;

/// The runs of a report that show the same images in a condition, while other runs of the report show others under its name.
///
/// A condition of a run alone has none. It is never stored: only a report on several runs sets it.
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
        Self {
            name: name.into(),
            runs: runs.into(),
        }
    }

    /// The name that the tables show.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether two groups have a run in common; `None` is all runs.
    #[must_use]
    pub fn meet(one: Option<&Self>, other: Option<&Self>) -> bool {
        one.zip(other)
            .is_none_or(|(one, other)| one.runs.iter().any(|run| other.runs.contains(run)))
    }
}

/// The name of the group as conditions and variants end with it: ` @RUN`.
impl fmt::Display for RunGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " @{}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_meet_in_a_run() {
        let group = |runs: &[usize]| RunGroup::new("a", runs);
        let (one, two, both) = (group(&[0]), group(&[1]), group(&[0, 1]));
        assert!(!RunGroup::meet(Some(&one), Some(&two)));
        assert!(RunGroup::meet(Some(&one), Some(&both)));
        assert!(RunGroup::meet(None, Some(&two)));
        assert_eq!(format!("L3-noise{one}"), "L3-noise @a");
    }
}
