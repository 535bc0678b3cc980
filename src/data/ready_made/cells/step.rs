//! Path from a cell to a value inside it: [`Step`].

use super::cell::Cell;
use super::text_list::parse_list;

/// Step of the path from a cell to a value inside it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Step {
    /// Item of a list, or of a text with a list.
    Item(usize),
    /// Field of a struct.
    Field(String),
}

impl Cell {
    /// Value at the end of a path; `None` if there is none.
    pub(crate) fn value_at(&self, steps: &[Step]) -> Option<Self> {
        let Some((step, rest)) = steps.split_first() else {
            return Some(self.clone());
        };
        match (self, step) {
            (Self::List(cells), Step::Item(index)) => cells.get(*index)?.value_at(rest),
            (Self::Text(text), Step::Item(index)) => {
                let item = parse_list(text)?.into_iter().nth(*index)?;
                Self::Text(item).value_at(rest)
            }
            (_, Step::Field(name)) => self.field(name)?.value_at(rest),
            (_, Step::Item(_)) => None,
        }
    }
}
