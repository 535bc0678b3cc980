//! Recipes: the settings and inputs that decide the pixels of an image.

pub mod image_recipe;
mod recipe;

pub use image_recipe::ImageRecipe;
pub use recipe::{Maker, Recipe};

pub(super) use recipe::ImageKeyFacts;
