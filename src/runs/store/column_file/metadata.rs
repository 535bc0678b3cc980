//! [`FileMetadata`]: the metadata of a Parquet file.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use parquet::file::metadata::ParquetMetaDataReader;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::guarded::guarded;
use darkqa_base::files::reading;

/// Value of `created_by` in the Parquet files of this program.
pub const CREATED_BY: &str = concat!("darkqa-eval version ", env!("CARGO_PKG_VERSION"));

/// The metadata of a Parquet file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileMetadata {
    /// The program that wrote the file.
    pub created_by: String,
    /// Custom metadata: values by key.
    pub pairs: BTreeMap<String, String>,
}

impl FileMetadata {
    /// Reads the metadata of a file; `None` if the file does not exist or is not a complete Parquet file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        let file = match reading::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        let footer = guarded(|| {
            let mut reader = ParquetMetaDataReader::new();
            reader.try_parse(&file).and_then(|()| reader.finish()).map_err(|e| e.to_string())
        });
        let Ok(footer) = footer else {
            return Ok(None);
        };
        let footer = footer.file_metadata();
        let pairs = footer
            .key_value_metadata()
            .into_iter()
            .flatten()
            .filter_map(|pair| Some((pair.key.clone(), pair.value.clone()?)))
            .collect();
        Ok(Some(Self { created_by: footer.created_by().unwrap_or_default().to_owned(), pairs }))
    }
}
