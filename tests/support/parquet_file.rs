//! A Parquet file, read by the library's own reader.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Map, Value, json};

fn open(path: &Path) -> SerializedFileReader<File> {
    SerializedFileReader::new(File::open(path).unwrap()).unwrap()
}

/// The rows of a file; bytes as hexadecimal digits.
pub fn rows(path: &Path) -> Vec<Map<String, Value>> {
    let rows = open(path);
    rows.get_row_iter(None)
        .unwrap()
        .map(|row| {
            let row = row.unwrap();
            let cells = row.get_column_iter();
            cells
                .map(|(name, field)| (name.clone(), value(field)))
                .collect()
        })
        .collect()
}

/// The metadata of a file by key.
pub fn metadata(path: &Path) -> BTreeMap<String, String> {
    let reader = open(path);
    let pairs = reader.metadata().file_metadata().key_value_metadata();
    pairs
        .into_iter()
        .flatten()
        .map(|pair| (pair.key.clone(), pair.value.clone().unwrap()))
        .collect()
}

/// The part of a file that holds its values: what stands before its footer.
pub fn body(path: &Path) -> Vec<u8> {
    let mut bytes = std::fs::read(path).unwrap();
    let end = bytes.len() - 8;
    let length = u32::from_le_bytes(bytes[end..end + 4].try_into().unwrap());
    bytes.truncate(end - length as usize);
    bytes
}

fn value(field: &Field) -> Value {
    match field {
        Field::Null => Value::Null,
        Field::Str(text) => json!(text),
        Field::Bytes(bytes) => {
            let digits = bytes.data().iter().map(|byte| format!("{byte:02x}"));
            json!(digits.collect::<String>())
        }
        Field::Byte(number) => json!(number),
        Field::Short(number) => json!(number),
        Field::Int(number) => json!(number),
        Field::Double(number) => json!(number),
        Field::Bool(is_so) => json!(is_so),
        other => panic!("{other:?}"),
    }
}
