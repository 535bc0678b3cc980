//! Recipes: the settings and inputs that decide the pixels of an image.

mod image_maker;
mod image_recipe;
pub(crate) mod image_words;
mod recipe;

pub(crate) use image_maker::Maker;
pub(crate) use image_recipe::ImageRecipe;
pub(super) use recipe::ImageKeyFacts;
pub(crate) use recipe::Recipe;
