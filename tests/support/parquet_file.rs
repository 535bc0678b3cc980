//! Parquet files, read and written by the library's own reader and writer.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{ColumnOrder, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::record::Field;
use parquet::schema::types::{Type, TypePtr};
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
            cells.map(|(name, field)| (name.clone(), value(field))).collect()
        })
        .collect()
}

/// The metadata of a file by key.
pub fn metadata(path: &Path) -> BTreeMap<String, String> {
    let reader = open(path);
    let pairs = reader.metadata().file_metadata().key_value_metadata();
    pairs.into_iter().flatten().map(|pair| (pair.key.clone(), pair.value.clone().unwrap())).collect()
}

/// True if every column of a file has the order of its type, which readers of any age know.
pub fn has_orders_of_types(path: &Path) -> bool {
    let reader = open(path);
    let orders = reader.metadata().file_metadata().column_orders();
    orders.is_some_and(|orders| orders.iter().all(|order| matches!(order, ColumnOrder::TYPE_DEFINED_ORDER(_))))
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

/// Values of a column.
pub enum Column {
    Integers(Vec<i64>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
    Texts(Vec<String>),
    Images(Vec<Vec<u8>>),
}

/// A Parquet file of one row group.
pub fn table<N: Into<String>>(columns: impl IntoIterator<Item = (N, Column)>) -> Vec<u8> {
    tables(vec![columns.into_iter().collect()])
}

/// A Parquet file of several row groups with the same columns.
pub fn tables<N: Into<String>>(groups: Vec<Vec<(N, Column)>>) -> Vec<u8> {
    let groups: Vec<Vec<(String, Column)>> = groups
        .into_iter()
        .map(|columns| {
            let named = columns.into_iter();
            named.map(|(name, column)| (name.into(), column)).collect()
        })
        .collect();
    let fields = groups.first().into_iter().flatten();
    let fields = fields.map(|(name, column)| column.field(name)).collect();
    let schema = Type::group_type_builder("schema").with_fields(fields);
    let schema = Arc::new(schema.build().unwrap());
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, properties).unwrap();
    for columns in groups {
        let mut group = writer.next_row_group().unwrap();
        for (_, column) in columns {
            column.write(&mut group);
        }
        group.close().unwrap();
    }
    writer.into_inner().unwrap()
}

impl Column {
    fn field(&self, name: &str) -> TypePtr {
        let leaf = |name: &str, physical, logical: Option<LogicalType>| {
            let builder = Type::primitive_type_builder(name, physical)
                .with_repetition(Repetition::OPTIONAL)
                .with_logical_type(logical);
            Arc::new(builder.build().unwrap())
        };
        let text = Some(LogicalType::String);
        match self {
            Self::Integers(_) => leaf(name, Physical::INT64, None),
            Self::Floats(_) => leaf(name, Physical::FLOAT, None),
            Self::Doubles(_) => leaf(name, Physical::DOUBLE, None),
            Self::Texts(_) => leaf(name, Physical::BYTE_ARRAY, text),
            Self::Images(_) => {
                let fields = vec![leaf("bytes", Physical::BYTE_ARRAY, None), leaf("path", Physical::BYTE_ARRAY, text)];
                let group = Type::group_type_builder(name).with_repetition(Repetition::OPTIONAL).with_fields(fields);
                Arc::new(group.build().unwrap())
            }
        }
    }

    fn write(&self, group: &mut SerializedRowGroupWriter<'_, Vec<u8>>) {
        let bytes = |text: &[u8]| ByteArray::from(text.to_vec());
        match self {
            Self::Integers(values) => write::<Int64Type>(group, values, 1),
            Self::Floats(values) => write::<FloatType>(group, values, 1),
            Self::Doubles(values) => write::<DoubleType>(group, values, 1),
            Self::Texts(values) => {
                let values: Vec<ByteArray> = values.iter().map(|text| bytes(text.as_bytes())).collect();
                write::<ByteArrayType>(group, &values, 1);
            }
            Self::Images(values) => {
                let files: Vec<ByteArray> = values.iter().map(|file| bytes(file)).collect();
                write::<ByteArrayType>(group, &files, 2);
                let names = (0..values.len()).map(|at| format!("frame-{at:06}.png"));
                let names: Vec<ByteArray> = names.map(|name| bytes(name.as_bytes())).collect();
                write::<ByteArrayType>(group, &names, 2);
            }
        }
    }
}

/// Writes the next column, without nulls, whose values have this definition level.
fn write<T: DataType>(group: &mut SerializedRowGroupWriter<'_, Vec<u8>>, values: &[T::T], level: i16) {
    let mut column = group.next_column().unwrap().unwrap();
    let levels = vec![level; values.len()];
    column.typed::<T>().write_batch(values, Some(&levels), None).unwrap();
    column.close().unwrap();
}
