//! Data sets: images, their maps, and the questions that came with them.
//!
//! The entry point is [`DataSource::open`]. The path decides the reader: a folder of frames ([`frames`]) or a
//! ready-made multiple-choice set ([`ready_made`]). Without a path the data are the built-in rooms ([`rooms`](darkqa_rooms)).

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod bank;
mod dark_photos;
mod dataset;
pub mod frame_folder;
pub mod frames;
pub mod import;
pub mod inputs;
pub mod maps;
pub mod openeqa;
pub mod pairs;
mod photographs;
pub mod ready_made;
mod root;
mod scene_args;
mod settings;
mod source;

pub use bank::{Bank, BankSource};
pub use dataset::Dataset;
pub use frames::{open_frames, open_images};
pub use maps::Picture;
pub use openeqa::ImageSource;
pub use photographs::Photographs;
pub use ready_made::{ParquetColumns, SetArgs, SkipBad, cached_snapshot, refuse_lfs_pointer};
pub use root::{Root, RootArgs};
pub use scene_args::SceneArgs;
pub use settings::{BankArgs, DataArgs, DecodeArgs, FolderArgs, PixelLimit, SelectionArgs, parse_data_source};
pub use source::DataSource;
