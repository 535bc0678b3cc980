//! Replies of all models to one item: [`PooledItem`].

/// Replies of all models to one item on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct PooledItem {
    /// Index of the item in the grid.
    pub(super) index: usize,
    /// Replies of each side.
    pub(super) sides: [SideCounts; 2],
    pub(super) state: PooledState,
}

impl PooledItem {
    /// Smallest and largest difference of the counted replies of both sides, which are equal if all replied; `counted`
    /// gives their number. `None` if a model was not asked, or without any reply, which tells nothing about the two
    /// sides.
    pub(super) fn net_bounds(&self, counted: impl Fn(&SideCounts) -> u32) -> Option<[i64; 2]> {
        let is_usable = match self.state {
            PooledState::Answered => true,
            PooledState::Missing => self.sides.iter().any(|side| side.replies > 0),
            PooledState::Unasked => false,
        };
        let [first, second] = [&self.sides[0], &self.sides[1]].map(|side| i64::from(counted(side)));
        let [first_missing, second_missing] = [0, 1].map(|side| i64::from(self.sides[side].missing));
        is_usable.then_some([first - second - second_missing, first + first_missing - second])
    }
}

/// Which models have a reply to an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PooledState {
    /// Every model replied on both sides.
    Answered,
    /// Every model was asked on both sides, and some replies are missing.
    Missing,
    /// Some model was not asked on a side.
    Unasked,
}

impl PooledState {
    /// State of an item over several models or levels.
    pub(super) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Answered, Self::Answered) => Self::Answered,
            (Self::Unasked, _) | (_, Self::Unasked) => Self::Unasked,
            _ => Self::Missing,
        }
    }
}

/// Numbers of replies of all models to one item on one side. If a model has no reply on either side, neither side
/// counts it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SideCounts {
    /// Counted replies in the strict parsing: right replies, or false answers.
    pub(super) strict: u32,
    /// Counted replies in the lenient parsing.
    pub(super) lenient: u32,
    /// Replies in which the strict parsing finds a choice.
    pub(super) read: u32,
    /// Replies.
    pub(super) replies: u32,
    /// Missing replies of models that replied on the other side.
    pub(super) missing: u32,
}

impl SideCounts {
    pub(super) fn add(self, other: Self) -> Self {
        Self {
            strict: self.strict + other.strict,
            lenient: self.lenient + other.lenient,
            read: self.read + other.read,
            replies: self.replies + other.replies,
            missing: self.missing + other.missing,
        }
    }
}
