//! The kinds of rooms, one file each: their size and furniture.

mod bathroom;
mod bedroom;
mod dining_room;
mod kitchen;
mod living_room;
mod office;
mod shared;

use super::dice::Dice;
use super::plan::FloorPlan;

/// A kind of room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RoomKind {
    Bedroom,
    Bathroom,
    Kitchen,
    LivingRoom,
    DiningRoom,
    Office,
}

impl RoomKind {
    /// All kinds, in the order in which scenes use them.
    pub(super) const ALL: [Self; 6] = [
        Self::Bedroom,
        Self::Bathroom,
        Self::Kitchen,
        Self::LivingRoom,
        Self::DiningRoom,
        Self::Office,
    ];

    /// The name of the kind, as `living room`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Bedroom => "bedroom",
            Self::Bathroom => "bathroom",
            Self::Kitchen => "kitchen",
            Self::LivingRoom => "living room",
            Self::DiningRoom => "dining room",
            Self::Office => "office",
        }
    }

    /// A furnished room of this kind.
    pub(super) fn furnish(self, dice: Dice) -> FloorPlan {
        let (mut plan, floor) = match self {
            Self::Bedroom => (bedroom::furnish(dice), "floor"),
            Self::Bathroom => (bathroom::furnish(dice), "bathfloor"),
            Self::Kitchen => (kitchen::furnish(dice), "kitchenfloor"),
            Self::LivingRoom => (living_room::furnish(dice), "floor"),
            Self::DiningRoom => (dining_room::furnish(dice), "floor"),
            Self::Office => (office::furnish(dice), "floor"),
        };
        plan.clutter(floor);
        plan.walls();
        plan
    }
}
