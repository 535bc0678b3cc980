//! Images: degraded, enhanced, calibrated, stored and exported.

mod calibrate;
mod camera;
mod enhance;
mod export;
mod image_store;
mod realism;
mod same_bytes;
mod synthesize;
