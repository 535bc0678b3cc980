//! Integrity check of the installed library with a receipt: [`check`].
//!
//! The header of a library shows that it is complete ([`super::library_file`]), but not that its bytes are unchanged.
//! So a file next to the installed library records its SHA-256, size and time of modification. The library (29 MB) is
//! hashed again only if size or time differ from this receipt.

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
    /// Time of the last modification, in nanoseconds since 1970; `None` if the system does not record it.
    modified: Option<String>,
}

/// Path of a library's receipt: the library's path followed by `.receipt.toml`.
fn path_for(library: &Path) -> PathBuf {
    let mut path = library.as_os_str().to_owned();
    path.push(".receipt.toml");
    path.into()
}

impl Receipt {
    /// Receipt for a library with this SHA-256 and the present size and time of its file.
    fn for_library(library: &Path, sha256: String) -> io::Result<Self> {
        let metadata = fs::metadata(library)?;
        Ok(Self {
            sha256,
            size: metadata.len(),
            modified: metadata
                .modified()
                .ok()
                .and_then(|time| time.duration_since(UNIX_EPOCH).ok())
                .map(|since_1970| since_1970.as_nanos().to_string()),
        })
    }

    /// Writes the receipt next to its library. If that fails, the library is hashed at each start.
    fn write(&self, library: &Path) {
        let result =
            toml::to_string(self).map_err(io::Error::other).and_then(|text| fs::write(path_for(library), text));
        if let Err(e) = result {
            tracing::debug!("{} has no receipt: {e}", library.display());
        }
    }
}

/// Checks that an installed library has this SHA-256, and writes a missing or outdated receipt.
///
/// # Errors
/// A message about the fault, to follow the library's path.
pub(super) fn check(library: &Path, sha256: &str) -> Result<(), String> {
    let expected = Receipt::for_library(library, sha256.to_owned()).map_err(|e| format!("cannot be read: {e}"))?;
    let stored: Option<Receipt> =
        fs::read_to_string(path_for(library)).ok().and_then(|text| toml::from_str(&text).ok());
    if stored.as_ref() == Some(&expected) {
        return Ok(());
    }
    let found = hash(library).map_err(|e| format!("cannot be read: {e}"))?;
    if found != sha256 {
        return Err(format!("has changed since its installation: its SHA-256 is {found} instead of {sha256}"));
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
    use std::time::SystemTime;

    use super::*;

    /// Writes a library and sets the time of its modification.
    fn write_at(library: &Path, content: &[u8], time: SystemTime) {
        fs::write(library, content).unwrap();
        let file = File::options().write(true).open(library).unwrap();
        file.set_modified(time).unwrap();
    }

    #[test]
    fn library_is_hashed_again_only_if_size_or_time_differ() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libonnxruntime.so.1.31.1");
        fs::write(&library, [7; 1000]).unwrap();
        let sha256 = hex(&Sha256::digest([7; 1000]));
        assert_eq!(check(&library, &sha256), Ok(()));
        let receipt = fs::read_to_string(path_for(&library)).unwrap();
        assert!(receipt.contains(&sha256) && receipt.contains("1000"), "{receipt}");
        // Other bytes go unnoticed while size and time match the receipt.
        let time = fs::metadata(&library).unwrap().modified().unwrap();
        write_at(&library, &[8; 1000], time);
        assert_eq!(check(&library, &sha256), Ok(()));
        write_at(&library, &[8; 999], time);
        assert!(check(&library, &sha256).unwrap_err().contains("has changed"));
        let later = time + std::time::Duration::from_secs(9);
        write_at(&library, &[7; 1000], later);
        // If only the time differs, the receipt is updated.
        assert_eq!(check(&library, &sha256), Ok(()));
        assert_ne!(fs::read_to_string(path_for(&library)).unwrap(), receipt);
    }

    #[test]
    fn invalid_receipt_counts_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("library");
        fs::write(&library, "library").unwrap();
        fs::write(path_for(&library), "size = [").unwrap();
        assert!(check(&library, "other").is_err());
        assert_eq!(check(&library, &hex(&Sha256::digest("library"))), Ok(()));
        assert!(check(&folder.path().join("missing"), "other").is_err());
    }
}
