//! Recipes: the settings and inputs that decide the pixels of an image.

pub(crate) mod image_recipe;
mod recipe;

pub(crate) use image_recipe::ImageRecipe;
pub(crate) use recipe::{Maker, Recipe};

pub(super) use recipe::ImageKeyFacts;
