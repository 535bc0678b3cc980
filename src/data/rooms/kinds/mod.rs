//! Kinds of rooms: size and furniture, one file for each kind.

mod bedroom;
mod kitchen;
mod living_room;
mod shared;

use super::plan::FloorPlan;
use super::seeded_rng::SeededRng;

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
    pub(super) const ALL: [Self; 6] =
        [Self::Bedroom, Self::Bathroom, Self::Kitchen, Self::LivingRoom, Self::DiningRoom, Self::Office];

    /// Name of the kind, such as `living room`.
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

    /// Creates a furnished room of this kind.
    pub(super) fn furnish(self, rng: SeededRng) -> FloorPlan {
        let (mut plan, floor) = match self {
            Self::Bedroom => (bedroom::furnish_bedroom(rng), "floor"),
            Self::Bathroom => (bedroom::furnish_bathroom(rng), "bathfloor"),
            Self::Kitchen => (kitchen::furnish_kitchen(rng), "kitchenfloor"),
            Self::LivingRoom => (living_room::furnish_living_room(rng), "floor"),
            Self::DiningRoom => (kitchen::furnish_dining_room(rng), "floor"),
            Self::Office => (living_room::furnish_office(rng), "floor"),
        };
        plan.add_clutter(floor);
        plan.add_walls();
        plan
    }
}
