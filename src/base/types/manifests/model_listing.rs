//! Order, groups, marks and extra columns of the models in a report's tables: [`ModelListing`].

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

/// A model from the models file, as tables show it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedModel {
    /// The name in tables.
    pub name: String,
    /// The heading under which tables show the model; `None` without a heading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
}

/// The models of a report. Their order in tables is: listed models without a group, unlisted models by name, then each
/// group; listed models keep the order of the list. Without a list the order is by name.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelListing {
    listed: Vec<ListedModel>,
    /// The groups in the order of their first models.
    groups: Vec<String>,
    /// Changes to the requests that a server's refusals made necessary, by model.
    adapted: BTreeMap<String, Vec<String>>,
    /// Cells of the extra columns, by column and model.
    cells: BTreeMap<(ModelColumn, String), String>,
    /// The extra columns of tables.
    columns: Vec<ModelColumn>,
    /// The names under which people answered.
    people: BTreeSet<String>,
    /// Data that enhancers were trained on, by the enhancer's name.
    training: BTreeMap<String, String>,
}

/// An extra column of tables, about the model of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
pub enum ModelColumn {
    /// Its name at the endpoint
    Id,
    /// The deployment, which tells two offers of one id apart
    Deployment,
    /// Its name in the server's replies
    Served,
}

impl ModelColumn {
    /// The head of the column.
    #[must_use]
    pub fn head(self) -> &'static str {
        match self {
            Self::Id => "id",
            Self::Deployment => "deployment",
            Self::Served => "served as",
        }
    }

    /// The name of the column in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Served => "served_model",
            other => other.head(),
        }
    }
}

/// The mark of a model whose requests were changed.
const MARK: char = '†';

/// Sort key of a model: the place of its group, then its own place among all listed models.
pub(super) type ModelPlace = (usize, usize);

impl ModelListing {
    /// A listing of these models; of several models with the same name the first counts.
    #[must_use]
    pub fn new(models: impl IntoIterator<Item = ListedModel>) -> Self {
        let mut order = Self::default();
        for model in models {
            if order.listed.iter().any(|known| known.name == model.name) {
                continue;
            }
            if let Some(group) = &model.group
                && !order.groups.contains(group)
            {
                order.groups.push(group.clone());
            }
            order.listed.push(model);
        }
        order
    }

    /// The sort key of a model. A name followed by a run or a time in brackets, as `gpt-4o (one)`, has the place of the
    /// bare name.
    pub fn place(&self, model: &str) -> ModelPlace {
        let Some(place) = self.index(model) else {
            return (0, self.listed.len());
        };
        let group =
            self.listed[place].group.as_ref().and_then(|group| self.groups.iter().position(|known| known == group));
        (group.map_or(0, |group| group + 1), place)
    }

    /// The heading of a model in tables; `None` without one.
    #[must_use]
    pub fn group(&self, model: &str) -> Option<&str> {
        self.listed[self.index(model)?].group.as_deref()
    }

    /// Whether any model has a group.
    #[must_use]
    pub fn has_groups(&self) -> bool {
        !self.groups.is_empty()
    }

    /// Records changes to the requests of a model.
    pub fn add_changes(&mut self, model: &str, changes: impl IntoIterator<Item = String>) {
        let known = self.adapted.entry(model.to_owned()).or_default();
        for change in changes {
            if !known.contains(&change) {
                known.push(change);
            }
        }
    }

    /// Records a name under which people answered.
    pub fn add_people(&mut self, name: String) {
        self.people.insert(name);
    }

    /// Records the data that an enhancer was trained on.
    pub fn add_training(&mut self, enhancer: &str, data: String) {
        self.training.insert(enhancer.to_owned(), data);
    }

    /// The enhancers with known training data, each with `trained on DATA`.
    pub fn trainings(&self) -> impl Iterator<Item = (&str, String)> {
        self.training.iter().map(|(enhancer, data)| (&**enhancer, trained_on(data)))
    }

    /// `trained on DATA` of an enhancer; `None` if its training data are unknown.
    #[must_use]
    pub fn training(&self, enhancer: &str) -> Option<String> {
        self.training.get(enhancer).map(|data| trained_on(data))
    }

    /// True if people answered under this name, or under the name before a run or a time in brackets, as `human (one)`.
    #[must_use]
    pub fn is_people(&self, name: &str) -> bool {
        self.people.iter().any(|people| {
            let rest = name.strip_prefix(&**people);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(" ("))
        })
    }

    /// Removes people from these models; if all of them are people, returns them all.
    pub fn without_people<'m>(&self, models: impl IntoIterator<Item = &'m str>) -> Vec<&'m str> {
        let (people, models): (Vec<&str>, Vec<&str>) = models.into_iter().partition(|model| self.is_people(model));
        if models.is_empty() { people } else { models }
    }

    /// Sets the cell of an extra column for a model.
    pub fn set_cell(&mut self, column: ModelColumn, model: String, value: String) {
        self.cells.insert((column, model), value);
    }

    /// Adds extra columns to the tables, each once.
    pub fn add_columns(&mut self, columns: &[ModelColumn]) {
        for column in columns {
            if !self.columns.contains(column) {
                self.columns.push(*column);
            }
        }
    }

    /// The extra columns.
    pub fn columns(&self) -> &[ModelColumn] {
        &self.columns
    }

    /// The cell of an extra column for a model; empty if unknown.
    pub fn cell(&self, column: ModelColumn, model: &str) -> &str {
        self.cells.get(&(column, model.to_owned())).map_or("", String::as_str)
    }

    /// The name of a model in tables, with a mark if its requests were changed.
    pub fn label(&self, model: &str) -> String {
        if self.adapted.contains_key(model) { format!("{model} {MARK}") } else { model.to_owned() }
    }

    /// Footnote that explains the mark, if one of these models has it.
    pub fn footnote<'m>(&self, models: impl IntoIterator<Item = &'m str>) -> Option<String> {
        let mut seen: Vec<&str> = Vec::new();
        let mut notes: Vec<String> = Vec::new();
        for model in models {
            if let Some(changes) = self.adapted.get(model)
                && !seen.contains(&model)
            {
                seen.push(model);
                notes.push(format!("{model}: {}", changes.join(", ")));
            }
        }
        (!notes.is_empty()).then(|| {
            format!("{MARK} requests were changed because the server refused what was set ({})", notes.join("; "))
        })
    }

    /// The index of a model in the list. Without the name itself, the longest name that it begins with before ` (`
    /// counts.
    fn index(&self, model: &str) -> Option<usize> {
        let exact = self.listed.iter().position(|known| known.name == model);
        exact.or_else(|| {
            self.listed
                .iter()
                .enumerate()
                .filter(|(_, known)| model.strip_prefix(&*known.name).is_some_and(|rest| rest.starts_with(" (")))
                .max_by_key(|(_, known)| known.name.len())
                .map(|(index, _)| index)
        })
    }
}

fn trained_on(data: &str) -> String {
    format!("trained on {data}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(name: &str, group: Option<&str>) -> ListedModel {
        ListedModel { name: name.to_owned(), group: group.map(str::to_owned) }
    }

    fn sorted<'a>(listing: &ModelListing, mut models: Vec<&'a str>) -> Vec<&'a str> {
        models.sort_by_key(|model| (listing.place(model), *model));
        models
    }

    #[test]
    fn models_keep_the_listed_order_within_groups() {
        let listing = ModelListing::new([
            listed("z", Some("large")),
            listed("m", None),
            listed("y", Some("small")),
            listed("a", Some("large")),
            listed("a", Some("small")),
        ]);
        assert_eq!(sorted(&listing, vec!["a", "b", "m", "y", "z"]), ["m", "b", "z", "a", "y"]);
        assert_eq!(listing.group("a"), Some("large"));
        assert_eq!((listing.group("m"), listing.group("b")), (None, None));
        assert!(listing.has_groups());
    }

    #[test]
    fn changed_models_have_a_mark_and_footnote() {
        let mut listing = ModelListing::default();
        listing.add_changes("a", ["no x is sent".to_owned(), "no y is sent".to_owned()]);
        listing.add_changes("a", ["no x is sent".to_owned()]);
        assert_eq!(listing.label("a"), "a †");
        assert_eq!(listing.label("b"), "b");
        let note = listing.footnote(["b", "a", "a"]).unwrap();
        assert!(note.ends_with("(a: no x is sent, no y is sent)"), "{note}");
        assert_eq!(listing.footnote(["b"]), None);
    }

    #[test]
    fn people_are_removed_unless_alone() {
        let mut listing = ModelListing::default();
        listing.add_people("human".to_owned());
        assert!(listing.is_people("human (one)") && !listing.is_people("humane"));
        assert_eq!(listing.without_people(["a", "human", "b"]), ["a", "b"]);
        assert_eq!(listing.without_people(["human"]), ["human"]);
    }

    #[test]
    fn unlisted_models_are_sorted_by_name() {
        let listing = ModelListing::default();
        assert_eq!(sorted(&listing, vec!["b", "c", "a"]), ["a", "b", "c"]);
        assert!(!listing.has_groups());
    }

    #[test]
    fn names_with_a_run_have_the_place_of_the_model() {
        let listing = ModelListing::new([listed("b", None), listed("a (fp8)", None), listed("a", Some("g"))]);
        assert_eq!(
            sorted(&listing, vec!["a (one)", "a (fp8) (one)", "ab", "b (two)"]),
            ["b (two)", "a (fp8) (one)", "ab", "a (one)"]
        );
        assert_eq!(listing.group("a (one)"), Some("g"));
        assert_eq!(listing.group("ab"), None);
    }
}
