//! Test sets: rows as JSON values, written in each format.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};
use serde_json::{Map, Value, json};

/// A PNG of one colour, large enough that its base64 is longer than a name.
pub(super) fn png(colour: u8) -> Vec<u8> {
    let image = RgbImage::from_fn(8, 8, |x, y| image::Rgb([colour, (x * 9) as u8, (y * 17) as u8]));
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, ImageFormat::Png).unwrap();
    file.into_inner()
}

/// A PNG in base64.
pub(super) fn base64(colour: u8) -> String {
    STANDARD.encode(png(colour))
}

/// A PNG in the format of hubs: its bytes and its path in one value.
pub(super) fn bytes(colour: u8) -> Value {
    json!({"bytes": base64(colour), "path": null})
}

/// A row with these fields.
pub(super) fn row(fields: Value) -> Map<String, Value> {
    match fields {
        Value::Object(fields) => fields,
        other => panic!("{other} is no row"),
    }
}

/// A temporary folder with a table. The extension of `name` decides its format. `bytes` in an object are base64.
pub(super) fn set(name: &str, rows: &[Map<String, Value>]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    write(&path, rows);
    (folder, path)
}

/// Writes rows in the format of the extension.
pub(super) fn write(path: &Path, rows: &[Map<String, Value>]) {
    let text = match path.extension().unwrap().to_str().unwrap() {
        "json" => serde_json::to_string_pretty(rows).unwrap(),
        "jsonl" => rows.iter().fold(String::new(), |text, row| text + &json!(row).to_string() + "\n"),
        "tsv" => table(rows, b'\t'),
        "csv" => table(rows, b','),
        "parquet" => return parquet(path, rows, None),
        other => panic!("no form {other}"),
    };
    fs::write(path, text).unwrap();
}

fn columns(rows: &[Map<String, Value>]) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for name in rows.iter().flat_map(Map::keys) {
        if !columns.contains(name) {
            columns.push(name.clone());
        }
    }
    columns
}

fn table(rows: &[Map<String, Value>], delimiter: u8) -> String {
    let columns = columns(rows);
    let mut writer = csv::WriterBuilder::new().delimiter(delimiter).from_writer(Vec::new());
    writer.write_record(&columns).unwrap();
    for row in rows {
        let cells = columns.iter().map(|column| match row.get(column) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(Value::Object(fields)) => fields["bytes"].as_str().unwrap().to_owned(),
            Some(other) => other.to_string(),
        });
        writer.write_record(cells).unwrap();
    }
    String::from_utf8(writer.into_inner().unwrap()).unwrap()
}

/// Type of a Parquet column, from its first value.
#[derive(Clone, Copy, PartialEq)]
enum ColumnType {
    Text,
    Number,
    Texts,
    Image,
    Images,
}

fn form(rows: &[Map<String, Value>], column: &str) -> ColumnType {
    match rows.iter().find_map(|row| row.get(column).filter(|value| !value.is_null())) {
        Some(Value::Number(_)) => ColumnType::Number,
        Some(Value::Array(items)) if items[0].is_object() => ColumnType::Images,
        Some(Value::Array(_)) => ColumnType::Texts,
        Some(Value::Object(_)) => ColumnType::Image,
        _ => ColumnType::Text,
    }
}

fn leaf(name: &str, physical: Physical, logical: Option<LogicalType>) -> TypePtr {
    Arc::new(
        Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()
            .unwrap(),
    )
}

fn group(name: &str, repetition: Repetition, logical: Option<LogicalType>, fields: Vec<TypePtr>) -> TypePtr {
    Arc::new(
        Type::group_type_builder(name)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .with_fields(fields)
            .build()
            .unwrap(),
    )
}

fn list(name: &str, item: TypePtr) -> TypePtr {
    let items = group("list", Repetition::REPEATED, None, vec![item]);
    group(name, Repetition::OPTIONAL, Some(LogicalType::List), vec![items])
}

fn image(name: &str) -> TypePtr {
    let fields =
        vec![leaf("bytes", Physical::BYTE_ARRAY, None), leaf("path", Physical::BYTE_ARRAY, Some(LogicalType::String))];
    group(name, Repetition::OPTIONAL, None, fields)
}

/// Values of a leaf with their definition and repetition levels.
#[derive(Default)]
struct LeafLevels {
    values: Vec<ByteArray>,
    defined: Vec<i16>,
    repeated: Vec<i16>,
}

impl LeafLevels {
    fn add(&mut self, value: Option<Vec<u8>>, defined: i16, absent: i16, repeated: i16) {
        self.defined.push(if value.is_some() { defined } else { absent });
        self.repeated.push(repeated);
        self.values.extend(value.map(ByteArray::from));
    }
}

/// A Parquet file whose metadata have these features, as the library `datasets` writes them.
pub(super) fn set_with_features(rows: &[Map<String, Value>], features: &Value) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.parquet");
    let info = serde_json::json!({"info": {"features": features}});
    let metadata = KeyValue::new("huggingface".to_owned(), info.to_string());
    parquet(&path, rows, Some(vec![metadata]));
    (folder, path)
}

/// Writes a Parquet file of two row groups, with the column types that hubs use.
fn parquet(path: &Path, rows: &[Map<String, Value>], metadata: Option<Vec<KeyValue>>) {
    let columns = columns(rows);
    let text = Some(LogicalType::String);
    let forms: Vec<ColumnType> = columns.iter().map(|column| form(rows, column)).collect();
    let fields = columns.iter().zip(&forms).map(|(column, form)| match form {
        ColumnType::Text => leaf(column, Physical::BYTE_ARRAY, text.clone()),
        ColumnType::Number => leaf(column, Physical::INT64, None),
        ColumnType::Texts => list(column, leaf("element", Physical::BYTE_ARRAY, text.clone())),
        ColumnType::Image => image(column),
        ColumnType::Images => list(column, image("element")),
    });
    let schema = group("schema", Repetition::REQUIRED, None, fields.collect());
    let schema =
        Arc::new(Type::group_type_builder("schema").with_fields(schema.get_fields().to_vec()).build().unwrap());
    let properties =
        WriterProperties::builder().set_compression(Compression::SNAPPY).set_key_value_metadata(metadata).build();
    let file = File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    let half = rows.len().div_ceil(2).max(1);
    for rows in rows.chunks(half) {
        let mut group = writer.next_row_group().unwrap();
        for (column, form) in columns.iter().zip(&forms) {
            let numbers = *form == ColumnType::Number;
            if numbers {
                let mut leaf = group.next_column().unwrap().unwrap();
                let values: Vec<i64> = rows.iter().filter_map(|row| row.get(column)?.as_i64()).collect();
                let defined: Vec<i16> =
                    rows.iter().map(|row| i16::from(row.get(column).is_some_and(Value::is_number))).collect();
                leaf.typed::<Int64Type>().write_batch(&values, Some(&defined), None).unwrap();
                leaf.close().unwrap();
                continue;
            }
            for levels in leaves(rows, column, *form) {
                let mut leaf = group.next_column().unwrap().unwrap();
                leaf.typed::<ByteArrayType>()
                    .write_batch(&levels.values, Some(&levels.defined), Some(&levels.repeated))
                    .unwrap();
                leaf.close().unwrap();
            }
        }
        group.close().unwrap();
    }
    writer.close().unwrap();
}

/// Leaves of a column of texts, lists or images.
fn leaves(rows: &[Map<String, Value>], column: &str, form: ColumnType) -> Vec<LeafLevels> {
    let cells = rows.iter().map(|row| row.get(column).filter(|value| !value.is_null()));
    match form {
        ColumnType::Text | ColumnType::Number => {
            let mut levels = LeafLevels::default();
            for cell in cells {
                let value = cell.map(|cell| cell.as_str().map_or_else(|| cell.to_string(), str::to_owned));
                levels.add(value.map(String::into_bytes), 1, 0, 0);
            }
            vec![levels]
        }
        ColumnType::Texts => {
            let mut levels = LeafLevels::default();
            for cell in cells {
                let Some(items) = cell.and_then(Value::as_array) else {
                    levels.add(None, 3, 0, 0);
                    continue;
                };
                for (at, item) in items.iter().enumerate() {
                    let text = item.as_str().map(|text| text.as_bytes().to_vec());
                    levels.add(text, 3, 2, i16::from(at > 0));
                }
            }
            vec![levels]
        }
        ColumnType::Image => {
            let (mut first, mut second) = (LeafLevels::default(), LeafLevels::default());
            for cell in cells {
                let absent = i16::from(cell.is_some());
                first.add(cell.and_then(decoded_bytes), 2, absent, 0);
                second.add(cell.and_then(path_bytes), 2, absent, 0);
            }
            vec![first, second]
        }
        ColumnType::Images => {
            let (mut first, mut second) = (LeafLevels::default(), LeafLevels::default());
            for cell in cells {
                let Some(items) = cell.and_then(Value::as_array) else {
                    first.add(None, 4, 0, 0);
                    second.add(None, 4, 0, 0);
                    continue;
                };
                for (at, item) in items.iter().enumerate() {
                    first.add(decoded_bytes(item), 4, 3, i16::from(at > 0));
                    second.add(path_bytes(item), 4, 3, i16::from(at > 0));
                }
            }
            vec![first, second]
        }
    }
}

fn path_bytes(value: &Value) -> Option<Vec<u8>> {
    value["path"].as_str().map(|text| text.as_bytes().to_vec())
}

fn decoded_bytes(value: &Value) -> Option<Vec<u8>> {
    let text = value["bytes"].as_str()?;
    Some(STANDARD.decode(text).unwrap())
}
