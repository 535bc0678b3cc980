//! The options of a row: [`Offered`].

/// The options of a row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Offered {
    pub(super) texts: Vec<String>,
    /// The place of each among its columns, by which letters and numbers name it: where B is empty, C is still C.
    pub(super) places: Vec<usize>,
    pub(super) origin: Origin,
}

/// Where options stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
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
            texts,
            places,
            origin,
        }
    }
}
