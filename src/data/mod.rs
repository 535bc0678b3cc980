//! Data sets: images, their maps, and the questions that came with them.
//!
//! The entry point is [`DataSource::open`]. The path decides the reader: a folder of frames ([`frames`]) or a
//! ready-made multiple-choice set ([`ready_made`]). Without a path the data are the built-in rooms ([`rooms`](crate::rooms)).

mod bank;
mod dark_photos;
mod dataset;
pub(crate) mod frame_folder;
pub(crate) mod frames;
pub(crate) mod import;
pub(crate) mod inputs;
pub(crate) mod maps;
pub(crate) mod openeqa;
pub(crate) mod pairs;
mod photographs;
pub(crate) mod ready_made;
mod root;
mod scene_args;
mod settings;
mod source;

pub(crate) use bank::{Bank, BankSource};
pub(crate) use frames::open_images;
pub(crate) use maps::Picture;
pub(crate) use openeqa::ImageSource;
pub(crate) use photographs::Photographs;
pub(crate) use ready_made::{ParquetColumns, SkipBad, cached_snapshot, refuse_lfs_pointer};
pub(crate) use root::{Root, RootArgs};
pub(crate) use scene_args::SceneArgs;
pub(crate) use settings::{BankArgs, DataArgs, DecodeArgs, FolderArgs, PixelLimit, SelectionArgs, parse_data_source};

pub use dataset::Dataset;
pub use frames::open_frames;
pub use ready_made::SetArgs;
pub use source::DataSource;
