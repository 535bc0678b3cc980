//! The models of a report as tables list them ([`ModelListing`]): their order, groups, marks and further columns.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

/// A model of a file of models, as tables show it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedModel {
    /// The name in tables.
    pub name: String,
    /// The heading under which tables show it; `None` for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
}

/// The models of a report, in order: first those without a group, then group by group, each as listed. Unlisted models follow those without
/// a group, by name. Without a list the order is by name.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelListing {
    listed: Vec<ListedModel>,
    /// The groups in the order of their first models.
    groups: Vec<String>,
    /// Changes to the requests that a server's refusals made necessary, by model.
    adapted: BTreeMap<String, Vec<String>>,
    /// Facts about each model, for the further columns.
    facts: BTreeMap<(ModelColumn, String), String>,
    /// The further columns of tables.
    columns: Vec<ModelColumn>,
    /// The names under which people answered.
    people: BTreeSet<String>,
    /// Data that enhancers were trained on, by the enhancer's name.
    training: BTreeMap<String, String>,
}

/// A further column of tables, about the model of a row.
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

/// The place of a model among others: of its group, and of the model within all that are listed.
pub(super) type ModelPlace = (usize, usize);

impl ModelListing {
    /// The order of these models; of several of one name the first counts.
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

    /// The place of a model. A name with a run or a time behind it, as `gpt-4o (one)`, stands where the name alone does.
    pub fn place(&self, model: &str) -> ModelPlace {
        let Some(place) = self.index(model) else {
            return (0, self.listed.len());
        };
        let group = self.listed[place].group.as_ref();
        let group = group.and_then(|group| self.groups.iter().position(|known| known == group));
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

    /// Notes that the requests to a model were changed in these ways.
    pub fn adapted(&mut self, model: &str, changes: impl IntoIterator<Item = String>) {
        let known = self.adapted.entry(model.to_owned()).or_default();
        for change in changes {
            if !known.contains(&change) {
                known.push(change);
            }
        }
    }

    /// Notes that people answered under this name.
    pub fn add_people(&mut self, name: String) {
        self.people.insert(name);
    }

    /// Notes the data that an enhancer was trained on.
    pub fn add_training(&mut self, enhancer: &str, data: String) {
        self.training.insert(enhancer.to_owned(), data);
    }

    /// The enhancers with known training data, each with `trained on DATA`.
    pub fn trainings(&self) -> impl Iterator<Item = (&str, String)> {
        self.training
            .iter()
            .map(|(enhancer, data)| (&**enhancer, trained_on(data)))
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

    /// These models without people; the people if there are no others.
    pub fn without_people<'m>(&self, models: impl IntoIterator<Item = &'m str>) -> Vec<&'m str> {
        let (people, models): (Vec<&str>, Vec<&str>) =
            models.into_iter().partition(|model| self.is_people(model));
        if models.is_empty() { people } else { models }
    }

    /// Notes what stands in a column about a model.
    pub fn note(&mut self, column: ModelColumn, model: String, value: String) {
        self.facts.insert((column, model), value);
    }

    /// The listing with further columns in tables, each once.
    pub fn show(&mut self, columns: &[ModelColumn]) {
        for column in columns {
            if !self.columns.contains(column) {
                self.columns.push(*column);
            }
        }
    }

    /// The further columns.
    pub fn columns(&self) -> &[ModelColumn] {
        &self.columns
    }

    /// Content of a further column for a model; empty if unknown.
    pub fn fact(&self, column: ModelColumn, model: &str) -> &str {
        let fact = self.facts.get(&(column, model.to_owned()));
        fact.map_or("", String::as_str)
    }

    /// The name of a model in tables, with a mark if its requests were changed.
    pub fn label(&self, model: &str) -> String {
        if self.adapted.contains_key(model) {
            format!("{model} {MARK}")
        } else {
            model.to_owned()
        }
    }

    /// Footnote that explains the mark, if one of these models has it.
    pub fn foot<'m>(&self, models: impl IntoIterator<Item = &'m str>) -> Option<String> {
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
            format!(
                "{MARK} requests were changed because the server refused what was set ({})",
                notes.join("; ")
            )
        })
    }

    fn index(&self, model: &str) -> Option<usize> {
        let exact = self.listed.iter().position(|known| known.name == model);
        exact.or_else(|| {
            let begins = |known: &ListedModel| {
                let rest = model.strip_prefix(&*known.name);
                rest.is_some_and(|rest| rest.starts_with(" ("))
            };
            let known = self.listed.iter().enumerate();
            let known = known.filter(|(_, known)| begins(known));
            let longest = known.max_by_key(|(_, known)| known.name.len());
            longest.map(|(index, _)| index)
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
        ListedModel {
            name: name.to_owned(),
            group: group.map(str::to_owned),
        }
    }

    fn sorted<'a>(listing: &ModelListing, mut models: Vec<&'a str>) -> Vec<&'a str> {
        models.sort_by_key(|model| (listing.place(model), *model));
        models
    }

    #[test]
    fn models_stand_as_listed_and_groups_together() {
        let listing = ModelListing::new([
            listed("z", Some("large")),
            listed("m", None),
            listed("y", Some("small")),
            listed("a", Some("large")),
            listed("a", Some("small")),
        ]);
        assert_eq!(
            sorted(&listing, vec!["a", "b", "m", "y", "z"]),
            ["m", "b", "z", "a", "y"]
        );
        assert_eq!(listing.group("a"), Some("large"));
        assert_eq!((listing.group("m"), listing.group("b")), (None, None));
        assert!(listing.has_groups());
    }

    #[test]
    fn changed_models_are_marked_and_the_mark_is_explained() {
        let mut listing = ModelListing::default();
        listing.adapted("a", ["no x is sent".to_owned(), "no y is sent".to_owned()]);
        listing.adapted("a", ["no x is sent".to_owned()]);
        assert_eq!(listing.label("a"), "a †");
        assert_eq!(listing.label("b"), "b");
        let foot = listing.foot(["b", "a", "a"]).unwrap();
        assert!(foot.ends_with("(a: no x is sent, no y is sent)"), "{foot}");
        assert_eq!(listing.foot(["b"]), None);
    }

    #[test]
    fn people_are_apart_unless_they_are_alone() {
        let mut listing = ModelListing::default();
        listing.add_people("human".to_owned());
        assert!(listing.is_people("human (one)") && !listing.is_people("humane"));
        assert_eq!(listing.without_people(["a", "human", "b"]), ["a", "b"]);
        assert_eq!(listing.without_people(["human"]), ["human"]);
    }

    #[test]
    fn without_a_list_names_decide() {
        let listing = ModelListing::default();
        assert_eq!(sorted(&listing, vec!["b", "c", "a"]), ["a", "b", "c"]);
        assert!(!listing.has_groups());
    }

    #[test]
    fn a_name_with_a_run_stands_where_the_name_does() {
        let listing = ModelListing::new([
            listed("b", None),
            listed("a (fp8)", None),
            listed("a", Some("g")),
        ]);
        assert_eq!(
            sorted(&listing, vec!["a (one)", "a (fp8) (one)", "ab", "b (two)"]),
            ["b (two)", "a (fp8) (one)", "ab", "a (one)"]
        );
        assert_eq!(listing.group("a (one)"), Some("g"));
        assert_eq!(listing.group("ab"), None);
    }
}
