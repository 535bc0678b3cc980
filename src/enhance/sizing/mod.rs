//! Input sizes of a model: whole images, padding, tiles, and sizes found by trial.

pub(super) mod reach;
mod size_plan;
mod tiles;

pub(super) use size_plan::{
    AcceptedSizes, CODES, MAX_WHOLE, MULTIPLES, PlanError, SeamRule, SizePlan, SizeRule, SizeSearch, count_image,
    count_planned, not_local, seams_differ, sizes_not_found, texture,
};
pub(super) use tiles::{TileWindow, TiledImage};

pub use tiles::Tiling;
