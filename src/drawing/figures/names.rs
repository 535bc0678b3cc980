//! The names that a reader gives in figures, and their order: [`Names`].

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, Result};
use crate::text::words::family as family_name;
use darkqa_score::findings::Findings;

/// Names as a reader wants them in figures; by default as they are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Names {
    /// Old and new names.
    labels: BTreeMap<String, String>,
    /// The models that have their short form, because no other name has it.
    shortened: Vec<String>,
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
    pub(crate) fn new(findings: &Findings<'_>) -> Self {
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

/// The short form of the name of a model: without "script:", folders and the ending of a file, as on the page.
fn short(name: &str) -> &str {
    let bare = name.strip_prefix("script:").unwrap_or(name);
    let bare = match bare.rsplit_once('/') {
        Some((_, last)) if !last.is_empty() => last,
        _ => bare,
    };
    let without_ending = bare
        .strip_suffix(".jsonl")
        .or_else(|| bare.strip_suffix(".json"));
    without_ending
        .filter(|name| !name.is_empty())
        .unwrap_or(bare)
}

/// Checks that one of these sets has a name.
fn check(flag: &str, name: &str, sets: &[&BTreeSet<String>]) -> Result<()> {
    if sets.iter().any(|set| set.contains(name)) {
        return Ok(());
    }
    let known: Vec<String> = sets
        .iter()
        .flat_map(|set| set.iter())
        .map(|name| format!("{name:?}"))
        .collect();
    let problem = format!("the runs have no {name:?}; they have {}", known.join(", "));
    Err(Error::usage(flag, problem))
}

impl Names {
    /// Names by `labels`, each an old and a new one, with those of `order` first, and one model drawn black. The other models have their
    /// short form where no other name has it.
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
        names.shorten(&known.models, &all);
        for set in all {
            let mut shown = BTreeMap::new();
            for name in set {
                if let Some(other) = shown.insert(names.shown(name), name) {
                    let problem = format!(
                        "{other:?} and {name:?} would both be called {:?}: give them different names",
                        names.shown(name)
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

    /// Gives models without a label their short form, if that is the name of nothing else.
    fn shorten(&mut self, models: &BTreeSet<String>, all: &[&BTreeSet<String>]) {
        let names = all.iter().flat_map(|set| set.iter());
        let mut uses: BTreeMap<String, usize> = BTreeMap::new();
        for name in names {
            let form = match self.labels.get(name) {
                Some(label) => label,
                None if models.contains(name) => short(name),
                None => name,
            };
            *uses.entry(form.to_owned()).or_default() += 1;
        }
        for model in models {
            let form = short(model);
            if form != model && !self.labels.contains_key(model) && uses[form] == 1 {
                self.labels.insert(model.clone(), form.to_owned());
                self.shortened.push(model.clone());
            }
        }
    }

    /// A sentence that states which models have a short form; empty if none has.
    pub(crate) fn said(&self) -> String {
        let forms: Vec<String> = self
            .shortened
            .iter()
            .map(|model| format!("{} is {model}", self.shown(model)))
            .collect();
        match &*forms {
            [] => String::new(),
            _ => format!("Short names: {}.", forms.join(", ")),
        }
    }

    /// The name that is shown.
    pub(super) fn shown(&self, name: &str) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_have_short_names_where_these_are_not_ambiguous() {
        let set = |names: &[&str]| names.iter().map(ToString::to_string).collect();
        let known = KnownNames {
            models: set(&[
                "script:sim-A.jsonl",
                "org/vlm-7b",
                "a/same",
                "b/same",
                "x/lift",
                "folder/",
            ]),
            enhancers: set(&["lift"]),
            families: BTreeSet::new(),
        };
        let names = Names::new(&[], &[], None, &known).unwrap();
        let shown = |name: &str| names.shown(name);
        assert_eq!(shown("script:sim-A.jsonl"), "sim-A");
        assert_eq!(shown("org/vlm-7b"), "vlm-7b");
        for name in ["a/same", "b/same", "x/lift", "folder/"] {
            assert_eq!(shown(name), name);
        }
        assert_eq!(
            names.said(),
            "Short names: vlm-7b is org/vlm-7b, sim-A is script:sim-A.jsonl."
        );
        let labels = [("org/vlm-7b".to_owned(), "sim-A".to_owned())];
        let names = Names::new(&labels, &[], None, &known).unwrap();
        assert_eq!(names.shown("script:sim-A.jsonl"), "script:sim-A.jsonl");
        assert_eq!(Names::default().said(), "");
    }
}
