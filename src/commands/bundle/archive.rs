//! The ZIP file of a bundle: [`zip_files`] and [`is_bundle`].

use std::fmt::Write as _;
use std::io::{self, Cursor, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::error::{Error, Result};
use crate::files::reading;

/// Comment of the archive, which identifies a bundle.
const MARK: &[u8] = b"darkqa.bundle/1";

/// Length of the end record of a ZIP file without its comment, in bytes.
const END_RECORD: usize = 22;

/// Name of the file with the digests of the others.
const SUMS: &str = "SHA256SUMS";

/// Compression level, the default of deflate.
const LEVEL: i64 = 6;

/// True if a file is a bundle. Only the end of the file is read, because the directory of a ZIP file may have millions
/// of entries.
pub(super) fn is_bundle(path: &Path) -> bool {
    // The comment follows the end record, whose last two bytes are the length of the comment.
    read_end(path, END_RECORD + MARK.len()).is_ok_and(|end| end.starts_with(b"PK\x05\x06") && end.ends_with(MARK))
}

/// The last `length` bytes of a file.
fn read_end(path: &Path, length: usize) -> io::Result<Vec<u8>> {
    let mut file = reading::open(path)?;
    file.seek(SeekFrom::End(-(length as i64)))?;
    let mut end = Vec::new();
    file.take(length as u64).read_to_end(&mut end)?;
    Ok(end)
}

/// Packs files into an archive, in a folder of this name, with a file of digests for `sha256sum`. The same files give
/// the same bytes: names are sorted, and all times are 1980-01-01.
///
/// # Errors
/// If the archive cannot be made.
pub(super) fn zip_files(folder: &str, mut files: Vec<(String, Vec<u8>)>) -> Result<Vec<u8>> {
    files.sort();
    files.push((SUMS.to_owned(), sums(&files).into_bytes()));
    files.sort();
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    archive.set_raw_comment(MARK.into());
    for (name, content) in files {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(LEVEL))
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644)
            .large_file(u32::try_from(content.len()).is_err());
        archive.start_file(format!("{folder}/{name}"), options).map_err(|e| failed(&e))?;
        archive.write_all(&content).map_err(|e| failed(&e))?;
    }
    let archive = archive.finish().map_err(|e| failed(&e))?;
    Ok(archive.into_inner())
}

fn failed(e: &dyn std::fmt::Display) -> Error {
    Error::data("the bundle", e)
}

/// A line for each file: its SHA-256 in hexadecimal, two spaces, and its name.
fn sums(files: &[(String, Vec<u8>)]) -> String {
    let mut sums = String::new();
    for (name, content) in files {
        for byte in Sha256::digest(content) {
            let _ = write!(sums, "{byte:02x}");
        }
        let _ = writeln!(sums, "  {name}");
    }
    sums
}

#[cfg(test)]
mod tests {
    use zip::ZipArchive;

    use super::*;

    fn zipped(files: Vec<(&str, &str)>) -> Vec<u8> {
        let files = files.into_iter().map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec()));
        zip_files("run", files.collect()).unwrap()
    }

    #[test]
    fn the_same_files_in_any_order_are_the_same_bytes() {
        let files = [("b.txt", "two"), ("a/c.txt", "one")];
        let bytes = zipped(files.to_vec());
        assert_eq!(bytes, zipped(files.into_iter().rev().collect()));
        assert_ne!(bytes, zipped(vec![("b.txt", "two")]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.zip");
        std::fs::write(&path, &bytes).unwrap();
        assert!(is_bundle(&path));
        std::fs::write(&path, b"PK, but no archive").unwrap();
        assert!(!is_bundle(&path));
        let mut archive = ZipArchive::new(Cursor::new(bytes)).unwrap();
        let names: Vec<&str> = archive.file_names().collect();
        assert_eq!(names.len(), 3, "{names:?}");
        let mut sums = archive.by_name("run/SHA256SUMS").unwrap();
        let text = std::io::read_to_string(&mut sums).unwrap();
        // echo -n two | sha256sum
        assert!(text.contains("3fc4ccfe745870e2c0d99f71f30ff0656c8dedd41cc1d7d3d376b0dbe685e2f3  b.txt\n"), "{text}");
    }
}
