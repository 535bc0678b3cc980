//! Receipt of the library that this program installed: [`Receipt`].
//!
//! The header of a library shows that it is whole ([`super::library_file`]), not that no byte of it has changed. So the
//! SHA-256 of the installed library stands in a file beside it, with its size and its time of modification. The library is
//! hashed again (29 MB) only if one of the two differs from the receipt.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// Content of a receipt, a TOML file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Receipt {
    /// SHA-256 of the library, in hexadecimal digits.
    sha256: String,
    /// Size of the library in bytes.
    size: u64,
    /// Time of its last modification, in nanoseconds since 1970; `None` if the system does not tell it.
    modified: Option<String>,
}

/// Path of a library's receipt: the library's path followed by `.receipt.toml`.
fn path_for(library: &Path) -> PathBuf {
    let mut path = library.as_os_str().to_owned();
    path.push(".receipt.toml");
    path.into()
}

impl Receipt {
    /// Receipt of a library with the given SHA-256, by the size and time that its file has now.
    fn for_library(library: &Path, sha256: String) -> io::Result<Self> {
        let metadata = fs::metadata(library)?;
        let modified = metadata.modified().ok();
        let since_1970 = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Ok(Self {
            sha256,
            size: metadata.len(),
            modified: since_1970.map(|time| time.as_nanos().to_string()),
        })
    }

    /// Writes the receipt beside its library. Where that is impossible, the library is hashed at each start.
    fn write(&self, library: &Path) {
        let written = toml::to_string(self).map_err(io::Error::other);
        if let Err(e) = written.and_then(|text| fs::write(path_for(library), text)) {
            tracing::debug!("{} has no receipt: {e}", library.display());
        }
    }
}

/// Checks that an installed library has the given SHA-256, and writes its receipt if it has changed or is missing.
///
/// # Errors
/// A description of the fault, to follow its path.
pub(super) fn check(library: &Path, sha256: &str) -> Result<(), String> {
    let unreadable = |e: io::Error| format!("cannot be read: {e}");
    let expected = Receipt::for_library(library, sha256.to_owned()).map_err(unreadable)?;
    let stored = fs::read_to_string(path_for(library)).ok();
    let stored: Option<Receipt> = stored.and_then(|text| toml::from_str(&text).ok());
    if stored.as_ref() == Some(&expected) {
        return Ok(());
    }
    let found = hash(library).map_err(unreadable)?;
    if found != sha256 {
        return Err(format!(
            "has changed since its installation: its SHA-256 is {found} instead of {sha256}"
        ));
    }
    expected.write(library);
    Ok(())
}

/// SHA-256 of a file, in hexadecimal digits.
fn hash(path: &Path) -> io::Result<String> {
    let (mut file, mut hasher) = (File::open(path)?, Sha256::new());
    let mut buffer = vec![0; 1 << 16];
    loop {
        let length = file.read(&mut buffer)?;
        if length == 0 {
            return Ok(hex(&hasher.finalize()));
        }
        hasher.update(&buffer[..length]);
    }
}

/// Bytes in hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .flat_map(|byte| [byte >> 4, byte & 15])
        .filter_map(|digit| char::from_digit(digit.into(), 16))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_library_is_noticed_and_an_unchanged_one_is_hashed_once() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libonnxruntime.so.1.31.1");
        fs::write(&library, [7; 1000]).unwrap();
        let sha256 = hex(&Sha256::digest([7; 1000]));
        assert_eq!(check(&library, &sha256), Ok(()));
        let receipt = fs::read_to_string(path_for(&library)).unwrap();
        assert!(
            receipt.contains(&sha256) && receipt.contains("1000"),
            "{receipt}"
        );
        // With the size and time of the receipt it is not hashed: another byte goes unnoticed.
        let time = fs::metadata(&library).unwrap().modified().unwrap();
        let set = |content: &[u8]| {
            fs::write(&library, content).unwrap();
            let file = File::options().write(true).open(&library).unwrap();
            file.set_modified(time).unwrap();
        };
        set(&[8; 1000]);
        assert_eq!(check(&library, &sha256), Ok(()));
        set(&[8; 999]);
        assert!(
            check(&library, &sha256)
                .unwrap_err()
                .contains("has changed")
        );
        set(&[7; 1000]);
        let later = time + std::time::Duration::from_secs(9);
        let file = File::options().write(true).open(&library).unwrap();
        file.set_modified(later).unwrap();
        // Only the time differs: hashed, and written down with the new time.
        assert_eq!(check(&library, &sha256), Ok(()));
        assert_ne!(fs::read_to_string(path_for(&library)).unwrap(), receipt);
    }

    #[test]
    fn a_broken_receipt_counts_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("library");
        fs::write(&library, "library").unwrap();
        fs::write(path_for(&library), "size = [").unwrap();
        assert!(check(&library, "other").is_err());
        assert_eq!(check(&library, &hex(&Sha256::digest("library"))), Ok(()));
        assert!(check(&folder.path().join("missing"), "other").is_err());
    }
}
