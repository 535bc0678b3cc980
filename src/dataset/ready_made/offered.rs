//! The options of a row: [`Offered`].

use std::collections::HashSet;
use std::sync::Arc;

/// The options of a row.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub(super) struct Offered {
    pub(super) texts: Arc<[String]>,
    /// The place of each among its columns, by which letters and numbers name it: where B is empty, C is still C.
    pub(super) places: Vec<usize>,
    pub(super) origin: Origin,
}

/// Where options stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) enum Origin {
    #[default]
    Columns,
    /// With their letters in the text of the question. Nothing numbers them.
    Question,
}

impl Offered {
    /// The options in the text of a question, in order.
    pub(super) fn lettered(texts: Vec<String>) -> Self {
        let origin = Origin::Question;
        Self {
            origin,
            ..Self::listed(texts)
        }
    }

    /// The options of a list, in order.
    pub(super) fn listed(texts: Vec<String>) -> Self {
        let places = (0..texts.len()).collect();
        let origin = Origin::Columns;
        Self {
            texts: texts.into(),
            places,
            origin,
        }
    }
}

/// The options of all rows. Equal ones are held once.
#[derive(Debug, Default)]
pub(super) struct AllOffered(HashSet<Arc<Offered>>);

impl AllOffered {
    pub(super) fn once(&mut self, offered: Offered) -> Arc<Offered> {
        if let Some(known) = self.0.get(&offered) {
            return Arc::clone(known);
        }
        let offered = Arc::new(offered);
        self.0.insert(Arc::clone(&offered));
        offered
    }
}
