//! The order of models in a report: [`ModelOrder`], as a file of models lists them ([`ListedModel`]).

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

/// The order of models: those without a group first, then group by group, each as listed. Models that are not listed stand behind
/// those without a group, by name. Without a list the order is that of the names.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ModelOrder {
    listed: Vec<ListedModel>,
    /// The groups in the order of their first models.
    groups: Vec<String>,
}

/// The place of a model among others: of its group, and of the model within all that are listed.
pub(crate) type ModelPlace = (usize, usize);

impl ModelOrder {
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
    pub(crate) fn place(&self, model: &str) -> ModelPlace {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(name: &str, group: Option<&str>) -> ListedModel {
        ListedModel {
            name: name.to_owned(),
            group: group.map(str::to_owned),
        }
    }

    fn sorted<'a>(order: &ModelOrder, mut models: Vec<&'a str>) -> Vec<&'a str> {
        models.sort_by_key(|model| (order.place(model), *model));
        models
    }

    #[test]
    fn models_stand_as_listed_and_groups_together() {
        let order = ModelOrder::new([
            listed("z", Some("large")),
            listed("m", None),
            listed("y", Some("small")),
            listed("a", Some("large")),
            listed("a", Some("small")),
        ]);
        assert_eq!(
            sorted(&order, vec!["a", "b", "m", "y", "z"]),
            ["m", "b", "z", "a", "y"]
        );
        assert_eq!(order.group("a"), Some("large"));
        assert_eq!((order.group("m"), order.group("b")), (None, None));
        assert!(order.has_groups());
    }

    #[test]
    fn without_a_list_names_decide() {
        let order = ModelOrder::default();
        assert_eq!(sorted(&order, vec!["b", "c", "a"]), ["a", "b", "c"]);
        assert!(!order.has_groups());
    }

    #[test]
    fn a_name_with_a_run_stands_where_the_name_does() {
        let order = ModelOrder::new([
            listed("b", None),
            listed("a (fp8)", None),
            listed("a", Some("g")),
        ]);
        assert_eq!(
            sorted(&order, vec!["a (one)", "a (fp8) (one)", "ab", "b (two)"]),
            ["b (two)", "a (fp8) (one)", "ab", "a (one)"]
        );
        assert_eq!(order.group("a (one)"), Some("g"));
        assert_eq!(order.group("ab"), None);
    }
}
