//! Display names and display order of models, enhancers and families in figures: [`DisplayNames`].

use std::collections::{BTreeMap, BTreeSet};

use crate::text::words::family as family_name;
use darkqa_base::error::{Error, Result};
use darkqa_score::findings::Findings;

/// Display names and order for figures. The default keeps the names and the order of the runs.
#[derive(Debug, Clone, Default)]
pub struct DisplayNames {
    /// Display name by recorded name.
    labels: BTreeMap<String, String>,
    /// Recorded names of the models that are displayed in their short form.
    shortened: Vec<String>,
    /// Recorded names that come first.
    order: Vec<String>,
    /// Recorded name of the model that is drawn in black.
    pub(super) black: Option<String>,
}

/// Names that occur in the runs.
#[derive(Debug, Clone)]
pub struct KnownNames {
    models: BTreeSet<String>,
    enhancers: BTreeSet<String>,
    families: BTreeSet<String>,
}

impl KnownNames {
    pub fn from_findings(findings: &Findings<'_>) -> Self {
        let subjects = &findings.grid.subjects;
        Self {
            models: subjects
                .iter()
                .filter(|subject| subject.view.is_some())
                .map(|subject| subject.model.clone())
                .collect(),
            enhancers: subjects
                .iter()
                .filter_map(|subject| subject.enhancer.as_ref())
                .map(ToString::to_string)
                .collect(),
            families: findings.grid.families().into_iter().map(|family| family_name(Some(family)).to_owned()).collect(),
        }
    }
}

/// Short form of a model's name, as on the page: without "script:", folders and the file extension.
pub fn short_form(name: &str) -> &str {
    let bare = name.strip_prefix("script:").unwrap_or(name);
    let bare = match bare.rsplit_once('/') {
        Some((_, last)) if !last.is_empty() => last,
        _ => bare,
    };
    let without_ending = bare.strip_suffix(".jsonl").or_else(|| bare.strip_suffix(".json"));
    without_ending.filter(|name| !name.is_empty()).unwrap_or(bare)
}

/// Checks that a name that was given by a flag occurs in one of the sets.
fn check_known(flag: &str, name: &str, sets: &[&BTreeSet<String>]) -> Result<()> {
    if sets.iter().any(|set| set.contains(name)) {
        return Ok(());
    }
    let known: Vec<String> = sets.iter().flat_map(|set| set.iter()).map(|name| format!("{name:?}")).collect();
    let problem = format!("the runs have no {name:?}; they have {}", known.join(", "));
    Err(Error::usage(flag, problem))
}

impl DisplayNames {
    /// Renames by `labels` (old and new name), puts the names of `order` first, and draws the model `black` in black. A
    /// model without a label gets its short form unless another name has it.
    ///
    /// # Errors
    /// If the runs lack a given name, if a name has two labels, or if two names would become the same.
    pub fn new(
        labels: &[(String, String)],
        order: &[String],
        black: Option<&String>,
        known: &KnownNames,
    ) -> Result<Self> {
        let all = [&known.models, &known.enhancers, &known.families];
        let mut names = Self { order: order.to_vec(), black: black.cloned(), ..Self::default() };
        for (old, new) in labels {
            check_known("--label", old, &all)?;
            if names.labels.insert(old.clone(), new.clone()).is_some() {
                let problem = format!("gives two names to {old:?}: leave one out");
                return Err(Error::usage("--label", problem));
            }
        }
        names.shorten(&known.models, &all);
        for set in all {
            let mut recorded = BTreeMap::new();
            for name in set {
                if let Some(other) = recorded.insert(names.display_name(name), name) {
                    let problem = format!(
                        "{other:?} and {name:?} would both be called {:?}: give them different names",
                        names.display_name(name)
                    );
                    return Err(Error::usage("--label", problem));
                }
            }
        }
        for name in order {
            check_known("--order", name, &all[..2])?;
        }
        if let Some(model) = black {
            check_known("--reference", model, &all[..1])?;
        }
        Ok(names)
    }

    /// Gives models without a label their short form, if no other name has it.
    fn shorten(&mut self, models: &BTreeSet<String>, all: &[&BTreeSet<String>]) {
        let mut uses: BTreeMap<String, usize> = BTreeMap::new();
        for name in all.iter().flat_map(|set| set.iter()) {
            let form = match self.labels.get(name) {
                Some(label) => label,
                None if models.contains(name) => short_form(name),
                None => name,
            };
            *uses.entry(form.to_owned()).or_default() += 1;
        }
        for model in models {
            let form = short_form(model);
            if form != model && !self.labels.contains_key(model) && uses[form] == 1 {
                self.labels.insert(model.clone(), form.to_owned());
                self.shortened.push(model.clone());
            }
        }
    }

    /// Sentence that explains the short names of models; empty without any.
    pub fn short_names_note(&self) -> String {
        let forms: Vec<String> =
            self.shortened.iter().map(|model| format!("{} is {model}", self.display_name(model))).collect();
        match &*forms {
            [] => String::new(),
            _ => format!("Short names: {}.", forms.join(", ")),
        }
    }

    /// Display name for a recorded name.
    pub(super) fn display_name(&self, name: &str) -> String {
        self.labels.get(name).map_or(name, String::as_str).to_owned()
    }

    /// Sorts items by the order that was given; items without a place in it follow, their order unchanged.
    pub(super) fn sort<'n, T: ?Sized + 'n>(&self, items: &mut [&'n T], name: impl Fn(&'n T) -> &'n str) {
        items.sort_by_key(|item| {
            let place = self.order.iter().position(|known| known == name(item));
            place.unwrap_or(self.order.len())
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn models_have_unambiguous_short_names() {
        let known = KnownNames {
            models: set(&["script:sim-A.jsonl", "org/vlm-7b", "a/same", "b/same", "x/lift", "folder/"]),
            enhancers: set(&["lift"]),
            families: BTreeSet::new(),
        };
        let names = DisplayNames::new(&[], &[], None, &known).unwrap();
        assert_eq!(names.display_name("script:sim-A.jsonl"), "sim-A");
        assert_eq!(names.display_name("org/vlm-7b"), "vlm-7b");
        for name in ["a/same", "b/same", "x/lift", "folder/"] {
            assert_eq!(names.display_name(name), name);
        }
        assert_eq!(names.short_names_note(), "Short names: vlm-7b is org/vlm-7b, sim-A is script:sim-A.jsonl.");
        let labels = [("org/vlm-7b".to_owned(), "sim-A".to_owned())];
        let names = DisplayNames::new(&labels, &[], None, &known).unwrap();
        assert_eq!(names.display_name("script:sim-A.jsonl"), "script:sim-A.jsonl");
        assert_eq!(DisplayNames::default().short_names_note(), "");
    }
}
