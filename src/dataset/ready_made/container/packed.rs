//! How far packed files are unpacked: [`unpacked`], [`most_unpacked`].

use std::io::{BufReader, Read as _};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::files::reading;

/// The longest content of a packed file of so many bytes: no table is packed to less than a two-hundredth, but what is meant to fill a
/// disk is.
pub(super) fn most_unpacked(packed: u64) -> u64 {
    packed.saturating_mul(200).max(1 << 30)
}

fn too_long(most: u64) -> String {
    format!(
        "unpacks to more than {} MB, which no table of its length does; unpack it and name the file in it",
        most >> 20
    )
}

/// An unpacked copy of a compressed file. Images are read at their places in it, which a compressed file does not have.
pub(super) fn unpacked(path: &Path) -> Result<NamedTempFile> {
    let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut copy =
        NamedTempFile::new().map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
    let most = most_unpacked(file.metadata().map_or(0, |facts| facts.len()));
    let mut content = MultiGzDecoder::new(BufReader::new(file)).take(most + 1);
    let copied = std::io::copy(&mut content, &mut copy)
        .map_err(|e| Error::data(path.display(), format_args!("cannot be unpacked: {e}")))?;
    if copied > most {
        return Err(Error::data(path.display(), too_long(most)));
    }
    Ok(copy)
}
