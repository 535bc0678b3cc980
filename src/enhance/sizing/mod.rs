//! Input sizes of a model: whole images, padding, tiles, and sizes found by trial.

pub(super) mod reach;
mod size_plan;
mod size_search;
mod sizes;
mod texture;
mod tiles;

pub(super) use size_plan::{MAX_WHOLE, PlanError, SeamRule, SizePlan, SizeRule, not_local, seams_differ};
pub(super) use size_search::{AcceptedSizes, MULTIPLES, SizeSearch, sizes_not_found};
pub(super) use sizes::{count_image, count_planned};
pub(super) use texture::{CODES, texture};
pub use tiles::Tiling;
pub(super) use tiles::{TileWindow, TiledImage};
