use std::borrow::Cow;

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::statistics::Statistics;
use parquet::record::Field;

use super::*;

/// A row with a value of each kind.
struct Values {
    key: [u8; 16],
    digest: Option<[u8; 32]>,
    name: &'static str,
    long: Option<String>,
    small: i64,
    number: Option<u64>,
    ev: Option<f64>,
    right: Option<bool>,
}

fn columns() -> Vec<Column<Values>> {
    use CellKind::{Bool, Digest, Double, Int8, Int32, Key, LongText, Text};
    use Presence::{Always, MayBeNull};
    fn column(
        name: &'static str,
        kind: CellKind,
        presence: Presence,
        value: for<'r> fn(&'r Values) -> Cell<'r>,
    ) -> Column<Values> {
        Column { name, kind, presence, value }
    }
    vec![
        column("key", Key, Always, |row| Cell::Bytes(&row.key)),
        column("digest", Digest, MayBeNull, |row| row.digest.as_ref().map_or(Cell::Null, |d| Cell::Bytes(d))),
        column("name", Text, Always, |row| Cell::text(Some(row.name))),
        column("long", LongText, MayBeNull, |row| Cell::text(row.long.as_deref())),
        column("small", Int8, Always, |row| Cell::int(Some(row.small))),
        column("number", Int32, MayBeNull, |row| Cell::int(row.number)),
        column("ev", Double, MayBeNull, |row| row.ev.map_or(Cell::Null, Cell::Double)),
        column("right", Bool, MayBeNull, |row| row.right.map_or(Cell::Null, Cell::Bool)),
    ]
}

fn row(index: u64) -> Values {
    let is_even = index.is_multiple_of(2);
    let mut key = [0; 16];
    key[..8].copy_from_slice(&index.to_be_bytes());
    Values {
        key,
        digest: is_even.then_some([7; 32]),
        name: if is_even { "even" } else { "odd\u{1b}\n" },
        long: is_even.then(|| format!("a reply {index}")),
        small: -3,
        number: is_even.then_some(index),
        ev: is_even.then_some(7.5),
        right: (!index.is_multiple_of(3)).then_some(is_even),
    }
}

fn metadata() -> FileMetadata {
    FileMetadata { created_by: CREATED_BY.to_owned(), pairs: [("darkqa.schema".to_owned(), "a/1".to_owned())].into() }
}

fn write(path: &Path, rows: &[Values], at_once: usize, limits: GroupLimits) {
    let columns = columns();
    let mut file = ColumnFile::create(path, &columns, &metadata()).unwrap();
    file.limits = limits;
    for some in rows.chunks(at_once) {
        file.append(some).unwrap();
    }
    assert!(!path.exists(), "an unfinished file has another name");
    assert!(file.finish().unwrap().is_empty());
}

/// The rows of a file as JSON, and the number of its row groups.
fn read(path: &Path) -> (Vec<serde_json::Value>, usize) {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let rows = reader
        .get_row_iter(None)
        .unwrap()
        .map(|row| row.unwrap().get_column_iter().map(|(name, field)| (name.clone(), value(field))).collect())
        .map(serde_json::Value::Object)
        .collect();
    (rows, reader.num_row_groups())
}

fn value(field: &Field) -> serde_json::Value {
    match field {
        Field::Null => serde_json::Value::Null,
        Field::Str(text) => text.as_str().into(),
        Field::Bytes(bytes) => serde_json::json!(bytes.data()),
        Field::Byte(number) => (*number).into(),
        Field::Int(number) => (*number).into(),
        Field::Double(number) => (*number).into(),
        Field::Bool(is_so) => (*is_so).into(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn values_and_nulls_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.parquet");
    let rows: Vec<Values> = (0..50_000).map(row).collect();
    write(&path, &rows, 16_384, LIMITS);
    let (read, groups) = read(&path);
    assert_eq!((read.len(), groups), (50_000, 1));
    for (row, read) in rows.iter().zip(read) {
        assert_eq!(read["name"], row.name);
        assert_eq!(read["long"], serde_json::json!(row.long));
        assert_eq!(read["small"], row.small);
        assert_eq!(read["number"], serde_json::json!(row.number));
        assert_eq!(read["ev"], serde_json::json!(row.ev));
        assert_eq!(read["right"], serde_json::json!(row.right));
        assert_eq!(read["digest"].is_null(), row.digest.is_none());
    }
    assert_eq!(FileMetadata::read(&path).unwrap(), Some(metadata()));
    let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
    let group = reader.metadata().row_group(0);
    let Some(Statistics::Int32(numbers)) = group.column(5).statistics() else {
        panic!("{:?}", group.column(5));
    };
    assert_eq!(
        (numbers.min_opt(), numbers.max_opt(), numbers.null_count_opt()),
        (Some(&0), Some(&49_998), Some(25_000))
    );
    // A text that many rows share is stored once.
    assert!(group.column(2).dictionary_page_offset().is_some());
    assert!(group.column(2).compressed_size() < 10_000);
    assert!(group.column(0).dictionary_page_offset().is_none());
}

#[test]
fn row_groups_have_limits_and_files_are_reproducible() {
    let folder = tempfile::tempdir().unwrap();
    let [one, two, three, empty] = ["one", "two", "three", "empty"].map(|name| folder.path().join(name));
    let rows: Vec<Values> = (0..5_000).map(row).collect();
    let by_rows = GroupLimits { rows: 2_048, long_bytes: usize::MAX };
    write(&one, &rows, 1_024, by_rows);
    write(&two, &rows, 1_024, by_rows);
    assert_eq!(fs::read(&one).unwrap(), fs::read(&two).unwrap());
    let (all, groups) = read(&one);
    assert_eq!((all.len(), groups), (5_000, 3));
    let by_bytes = GroupLimits { rows: usize::MAX, long_bytes: 20_000 };
    write(&three, &rows, 100, by_bytes);
    let (same, groups) = read(&three);
    assert_eq!(same, all);
    assert!((2..=4).contains(&groups), "{groups}");
    write(&empty, &[], 1, LIMITS);
    assert_eq!(read(&empty), (Vec::new(), 0));
}

#[test]
fn misfits_are_null_or_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table");
    let columns = columns();
    let mut file = ColumnFile::create(&path, &columns, &metadata()).unwrap();
    let number = Some(u64::MAX);
    file.append(&[Values { number, ..row(0) }, row(1), row(2)]).unwrap();
    assert_eq!(file.finish().unwrap(), [("number", 1)].into());
    let (rows, _) = read(&path);
    assert!(rows[0]["number"].is_null() && rows[2]["number"] == 2);
    let mut file = ColumnFile::create(&path, &columns, &metadata()).unwrap();
    let problem = file.append(&[Values { small: 200, ..row(0) }]);
    let problem = problem.unwrap_err().to_string();
    assert!(problem.contains("no value in the column small"), "{problem}");
    let wrong = vec![Column {
        value: |_: &Values| Cell::Text(Cow::Borrowed("a text")),
        name: "ev",
        kind: CellKind::Double,
        presence: Presence::Always,
    }];
    let mut file = ColumnFile::create(&path, &wrong, &metadata()).unwrap();
    let problem = file.append(&[row(0)]).unwrap_err().to_string();
    assert!(problem.contains("not a value of the column ev"), "{problem}");
}

#[test]
fn missing_and_damaged_files_have_no_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table");
    assert_eq!(FileMetadata::read(&path).unwrap(), None);
    write(&path, &[row(0)], 1, LIMITS);
    let whole = fs::read(&path).unwrap();
    for cut in [0, 3, whole.len() / 2, whole.len() - 1] {
        fs::write(&path, &whole[..cut]).unwrap();
        assert_eq!(FileMetadata::read(&path).unwrap(), None, "{cut}");
    }
}

#[test]
fn numbers_that_do_not_fit_are_none() {
    for (kind, number, stored) in [
        (CellKind::Int8, 127, Some(127)),
        (CellKind::Int8, 128, None),
        (CellKind::Int8, -128, Some(-128)),
        (CellKind::Int16, -32769, None),
        (CellKind::Int32, 2_147_483_647, Some(i32::MAX)),
        (CellKind::Int32, 2_147_483_648, None),
        (CellKind::Int32, i128::from(u64::MAX), None),
        (CellKind::Text, 1, None),
    ] {
        assert_eq!(kind.to_stored(number), stored, "{kind:?} {number}");
    }
    assert_eq!(Cell::int(Some(u64::MAX)), Cell::Int(u64::MAX.into()));
    assert_eq!(Cell::int(None::<u8>), Cell::Null);
}
