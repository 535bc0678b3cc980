//! Flags of the image store: [`StoreArgs`].

use std::path::PathBuf;

use clap::Args;

use super::access::ImageStore;
use super::image_set::ImageSet;
use super::kinds::StoredKinds;
use crate::error::Result;
use crate::files::folder_access::FolderAccess;
use crate::types::Decides;
use crate::types::flags::positive;

/// Flags of the folder in which images are kept for other runs.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Scale")]
#[expect(clippy::struct_field_names, reason = "the names of the flags")]
pub(crate) struct StoreArgs {
    /// Folder of stored images, shared by runs, models, shards and processes; it may be deleted at any time;
    /// `darkqa-eval cache DIR` lists it; default: no image is stored
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub images_cache: Option<PathBuf>,
    /// Images to store
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = StoredKinds::Enhanced, add = Decides::Nothing)]
    pub images_cache_what: StoredKinds,
    /// Maximum size in GB (10⁹ bytes); when it is reached, images unused for 14 days are removed; if there are none, no
    /// image is added
    #[arg(long, value_name = "GB", value_parser = positive, default_value = "20", add = Decides::Nothing)]
    pub images_cache_size: f64,
}

impl StoreArgs {
    /// An empty estimate of the images that the store would keep; `None` without a store.
    pub(crate) fn image_set(&self) -> Option<ImageSet> {
        let set = ImageSet::new(self.images_cache_what, self.images_cache_size * 1e9);
        self.images_cache.is_some().then_some(set)
    }

    /// Opens the store; `None` if the flags name no folder.
    ///
    /// # Errors
    /// If the folder cannot be created or read.
    pub(crate) fn open(&self, access: FolderAccess) -> Result<Option<ImageStore>> {
        let bytes = (self.images_cache_size * 1e9) as u64;
        self.images_cache
            .as_deref()
            .map(|folder| ImageStore::open(folder, access, self.images_cache_what, bytes))
            .transpose()
    }
}
