//! Hot pixels, which are left out of all sums: [`HotPixels`].

/// Hot pixels by part of a row, see [`Layout::place`](super::layout::Layout::place).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct HotPixels {
    /// Columns within the plane for each part of a row, in ascending order.
    columns: Vec<Vec<u32>>,
    count: usize,
}

impl HotPixels {
    /// Hot pixels by part of a row; each list of columns must be in ascending order.
    pub(super) fn new(columns: Vec<Vec<u32>>) -> Self {
        let count = columns.iter().map(Vec::len).sum();
        Self { columns, count }
    }

    /// No hot pixels, in a layout with this number of parts of rows.
    pub(super) fn none(plane_rows: usize) -> Self {
        Self::new(vec![Vec::new(); plane_rows])
    }

    /// Hot columns in a part of a row.
    pub(super) fn columns(&self, plane_row: usize) -> impl Iterator<Item = usize> + '_ {
        self.columns[plane_row].iter().map(|column| *column as usize)
    }

    /// Number of hot pixels.
    pub(super) fn count(&self) -> usize {
        self.count
    }
}
