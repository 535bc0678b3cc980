//! Why a candidate is not asked: [`Reason`].

use serde::{Deserialize, Serialize};

/// Why a candidate cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The frame has no room.
    NoRoom,
    /// Too little of the frame is labelled.
    Unlabelled,
    /// Too little is seen: a bare wall is no room.
    Bare,
    /// The frame's room is not the one that the answer needs.
    OtherRoom,
    /// What makes the answer true is not seen well enough.
    Unseen,
    /// What the answer denies, or what would do at a pinch, is seen.
    Seen,
    /// Too large a part of the frame has no label, so that anything may hide there.
    Void,
    /// A mirror shows what is elsewhere.
    Mirror,
    /// The data set has no label for it, so that it may hide under another.
    Inexpressible,
    /// Something is seen that may be taken for it.
    Confusable,
    /// It is rare in such rooms: the answer would be guessed without looking.
    Implausible,
    /// Its segment is in another room.
    Elsewhere,
    /// Its segment has several classes.
    Mixed,
    /// Its word is not what its class is called.
    Unlike,
    /// Its segment is too small.
    Small,
    /// Its segment is too thin.
    Thin,
    /// Its segment is cut by the frame's border.
    Cut,
    /// There are several of its class.
    NotUnique,
    /// It is over-exposed.
    Bright,
    /// It is crushed to black.
    Crushed,
    /// No colour dominates.
    Motley,
    /// Its colour has no name that people agree on.
    Nameless,
    /// Its colour is none of those offered.
    NotOffered,
    /// The frame has no depth.
    NoDepth,
    /// The frame's depths are none of a room: its scale is wrong.
    Scale,
    /// Fewer than two objects, or objects of one class only.
    Few,
    /// The two nearest are too near to each other.
    Gap,
    /// The nearest by its median is not the nearest by its near end.
    Disputed,
    /// Something that is not offered may be nearer.
    Rival,
    /// Something large has no depth.
    Unmeasured,
}
