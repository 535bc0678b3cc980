//! The names that a reader gives in figures, and their order: [`Names`].

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, Result};
use crate::report::words::family as family_name;
use crate::score::findings::Findings;

/// Names as a reader wants them in figures; by default as they are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Names {
    labels: BTreeMap<String, String>,
    order: Vec<String>,
    /// The model that is drawn black.
    pub(super) black: Option<String>,
}

/// The names that the runs have.
#[derive(Debug, Clone)]
pub(crate) struct KnownNames {
    models: BTreeSet<String>,
    enhancers: BTreeSet<String>,
    families: BTreeSet<String>,
}

impl KnownNames {
    /// The names in these findings.
    pub(crate) fn of(findings: &Findings<'_>) -> Self {
        let subjects = &findings.grid.subjects;
        let asked = subjects.iter().filter(|subject| subject.view.is_some());
        let enhancers = subjects.iter().filter_map(|of| of.enhancer.as_ref());
        let families = findings.grid.families().into_iter();
        Self {
            models: asked.map(|subject| subject.model.clone()).collect(),
            enhancers: enhancers.map(ToString::to_string).collect(),
            families: families
                .map(|family| family_name(Some(family)).to_owned())
                .collect(),
        }
    }
}

/// Checks that one of these sets has a name.
fn check(flag: &str, name: &str, sets: &[&BTreeSet<String>]) -> Result<()> {
    if sets.iter().any(|set| set.contains(name)) {
        return Ok(());
    }
    let known = sets.iter().flat_map(|set| set.iter());
    let known: Vec<String> = known.map(|name| format!("{name:?}")).collect();
    let problem = format!("the runs have no {name:?}; they have {}", known.join(", "));
    Err(Error::usage(flag, problem))
}

impl Names {
    /// Names by `labels`, each an old and a new one, with those of `order` first, and one model drawn black.
    ///
    /// # Errors
    /// If the runs do not have a name, if a name has two labels, or if two names would become one.
    pub(crate) fn new(
        labels: &[(String, String)],
        order: &[String],
        black: Option<&String>,
        known: &KnownNames,
    ) -> Result<Self> {
        let all = [&known.models, &known.enhancers, &known.families];
        let mut names = Self {
            order: order.to_vec(),
            black: black.cloned(),
            ..Self::default()
        };
        for (old, new) in labels {
            check("--label", old, &all)?;
            if names.labels.insert(old.clone(), new.clone()).is_some() {
                let problem = format!("gives two names to {old:?}: leave one out");
                return Err(Error::usage("--label", problem));
            }
        }
        for set in all {
            let mut shown = BTreeMap::new();
            for name in set {
                if let Some(other) = shown.insert(names.of(name), name) {
                    let problem = format!(
                        "{other:?} and {name:?} would both be called {:?}: give them different names",
                        names.of(name)
                    );
                    return Err(Error::usage("--label", problem));
                }
            }
        }
        for name in order {
            check("--order", name, &all[..2])?;
        }
        if let Some(model) = black {
            check("--reference", model, &all[..1])?;
        }
        Ok(names)
    }

    /// The name that is shown.
    pub(super) fn of(&self, name: &str) -> String {
        self.labels
            .get(name)
            .map_or(name, String::as_str)
            .to_owned()
    }

    /// Puts those first that the reader named, in that order; the others follow as they are.
    pub(super) fn order<'n, T: ?Sized + 'n>(
        &self,
        items: &mut [&'n T],
        name: impl Fn(&'n T) -> &'n str,
    ) {
        let place = |item: &&'n T| {
            let place = self.order.iter().position(|known| known == name(item));
            place.unwrap_or(self.order.len())
        };
        items.sort_by_key(place);
    }
}
