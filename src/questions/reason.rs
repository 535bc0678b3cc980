//! Reasons why a candidate cannot be asked: [`Reason`].

use serde::{Deserialize, Serialize};

/// Reason why a candidate cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The room type of the frame is unknown.
    NoRoom,
    /// Too little of the frame is labelled.
    Unlabelled,
    /// Too few objects are visible, such as only a bare wall.
    Bare,
    /// The answer needs another type of room.
    OtherRoom,
    /// The objects that make the answer true are not visible well enough.
    Unseen,
    /// An object that the activity needs, or a substitute for it, is visible.
    Seen,
    /// Too much of the frame has no label; any object may be there.
    Void,
    /// A large mirror shows objects that are elsewhere.
    Mirror,
    /// The data set has no label or word for the object; it may be part of another label.
    Inexpressible,
    /// A coarse class that may contain the object is visible.
    Hidden,
    /// The segment has no specific word, or one that questions do not use.
    Wordless,
    /// An object that may be mistaken for the class is visible.
    Confusable,
    /// The class is rare in such rooms, so the answer could be guessed without the image.
    Implausible,
    /// The segment is in another room.
    Elsewhere,
    /// The segment contains several classes.
    Mixed,
    /// The word of the segment does not fit its class in plain English, such as a dog bed in the class bed.
    Unlike,
    /// The area of the segment is too small.
    Small,
    /// The segment is too thin.
    Thin,
    /// The border of the frame cuts the segment.
    Cut,
    /// The frame has several objects of the class.
    NotUnique,
    /// Too many pixels are over-exposed.
    Bright,
    /// Too many pixels are black.
    Crushed,
    /// No colour dominates the object.
    Motley,
    /// People do not agree on a name for the colour.
    Nameless,
    /// Relative to the light of the frame or around the object, the colour has another name: a white object in shade
    /// looks grey.
    Lit,
    /// The object has another colour in another view.
    Disagreed,
    /// The colour is not one of the choices.
    NotOffered,
    /// The frame has no depth.
    NoDepth,
    /// The median depth does not fit a room: the scale of the depth is wrong.
    Scale,
    /// Fewer than two objects are visible, or objects of one class only.
    Few,
    /// The depths of the two nearest objects differ too little.
    Gap,
    /// The object with the smallest median depth does not have the smallest 10 % quantile.
    Disputed,
    /// An object that is not among the choices may be nearer.
    Rival,
    /// A large object has no depth.
    Unmeasured,
}
