//! The way from a cell to a value inside it: [`Step`].

use super::cell::Cell;
use super::text_list::list;

/// A step from a cell to a value inside it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(in crate::dataset::ready_made) enum Step {
    /// An item of a list, or of the text of a list.
    Item(usize),
    /// A field of a struct.
    Field(String),
}

impl Cell {
    /// The value at some steps.
    pub(in crate::dataset::ready_made) fn at(&self, steps: &[Step]) -> Option<Self> {
        let Some((step, rest)) = steps.split_first() else {
            return Some(self.clone());
        };
        match (self, step) {
            (Self::List(cells), Step::Item(at)) => cells.get(*at)?.at(rest),
            (Self::Text(text), Step::Item(at)) => {
                let item = list(text)?.into_iter().nth(*at)?;
                Self::Text(item).at(rest)
            }
            (_, Step::Field(name)) => self.field(name)?.at(rest),
            (_, Step::Item(_)) => None,
        }
    }
}
