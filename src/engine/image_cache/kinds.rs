//! Kinds of images that a store keeps: [`StoredKinds`].

use clap::ValueEnum;

use crate::types::flags::flag_words;

/// Which images are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum StoredKinds {
    /// Enhanced images; of the others PSNR and SSIM alone
    Enhanced,
    /// Degraded ones too, which are made faster than a network share is read: for slow processors and fast disks
    All,
}

flag_words!(StoredKinds);
