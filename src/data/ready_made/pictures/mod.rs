//! Images of the rows, and the frames, question ids and scenes that depend on them.

mod frames;
mod ids;
mod image_marks;
mod images;
mod scenes;

pub(super) use frames::Frames;
pub(crate) use frames::Series;
pub(super) use ids::Ids;
pub(super) use image_marks::ImageMarks;
pub(crate) use images::EmbeddedImage;
pub(super) use images::{ImageForm, images};
pub(crate) use scenes::SceneNames;
pub(super) use scenes::Scenes;
