//! Decompression of files up to a limit: [`decompress_gzip`], [`max_decompressed_size`].

use std::io::{BufReader, Read as _};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::files::reading;

/// Maximum decompressed size of a file with this compressed size, in bytes: a gigabyte, or 200 times the compressed
/// size (chosen). No table compresses better, but decompression bombs do.
pub(super) fn max_decompressed_size(compressed: u64) -> u64 {
    compressed.saturating_mul(200).max(1 << 30)
}

/// Decompresses a file to a temporary copy. A compressed file does not allow to read images at their offsets.
pub(super) fn decompress_gzip(path: &Path) -> Result<NamedTempFile> {
    let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut copy = NamedTempFile::new().map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
    let max = max_decompressed_size(file.metadata().map_or(0, |metadata| metadata.len()));
    let mut content = MultiGzDecoder::new(BufReader::new(file)).take(max + 1);
    let copied = std::io::copy(&mut content, &mut copy)
        .map_err(|e| Error::data(path.display(), format_args!("cannot be unpacked: {e}")))?;
    if copied > max {
        let problem = format_args!(
            "unpacks to more than {} MB, which no table of its length does; unpack it and name the file in it",
            max >> 20
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok(copy)
}
