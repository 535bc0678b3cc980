//! Images of the rows, and the frames, question ids and scenes that depend on them.

mod frames;
mod ids;
mod images;

pub(super) use frames::SetFrames;
pub(super) use ids::{Ids, Scenes};
pub(super) use images::{ImageForm, ImageMarks, images};

pub(crate) use frames::Series;
pub(crate) use ids::SceneNames;
pub(crate) use images::EmbeddedImage;
