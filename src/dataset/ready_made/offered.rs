//! The options of a row: [`Offered`].

/// The options of a row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Offered {
    pub(super) texts: Vec<String>,
    /// The place of each among its columns, by which letters and numbers name it: where B is empty, C is still C.
    pub(super) places: Vec<usize>,
}

impl Offered {
    /// The options of a list, in order.
    pub(super) fn listed(texts: Vec<String>) -> Self {
        let places = (0..texts.len()).collect();
        Self { texts, places }
    }
}
