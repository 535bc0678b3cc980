//! Data: imports, ready-made sets, photographs, rooms and questions.

mod hm3d;
mod import;
mod inputs;
mod lerobot;
mod odd_recordings;
mod photographs;
mod questions;
mod ready_made;
mod recordings;
mod remedies;
mod rooms;
mod scenes;
mod unlabelled;
mod videos;
