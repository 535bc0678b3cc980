#!/usr/bin/env bash
# The rows of the Rust crate parquet give a timestamp in nanoseconds as a bare integer, and one in microseconds as time.
#
# Guess: every unit comes out as a timestamp, as the type is in the file; pyarrow reads all of them as such.
# Seen with parquet 60.1.0 against pyarrow 26.0.1: one second after 1970 is TimestampMillis(1000) and
# TimestampMicros(1000000) from ms and us, but Long(1000000000) from ns. In JSON it is a number, not a date. Seconds are
# stored as milliseconds by the writer. So code that takes any integer for a count, and a Timestamp for a time, mistakes
# a column that pandas writes with its usual unit.
# Builds a small program with cargo.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pyarrow==26.0.1
"$folder/venv/bin/python" - "$folder/times.parquet" <<'PYTHON'
import sys

import pyarrow as pa
import pyarrow.parquet

units = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
table = pa.table({unit: pa.array([count], pa.timestamp(unit)) for unit, count in units.items()})
pyarrow.parquet.write_table(table, sys.argv[1])
print(f"pyarrow {pa.__version__}: {[str(part.type) for part in pyarrow.parquet.read_table(sys.argv[1]).schema]}")
PYTHON
mkdir "$folder/src"
cat > "$folder/Cargo.toml" <<'TOML'
[package]
name = "probe"
version = "0.1.0"
edition = "2021"
[dependencies]
parquet = { version = "=60.1.0", default-features = false, features = ["snap"] }
TOML
cat > "$folder/src/main.rs" <<'RUST'
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

fn main() {
    let file = std::fs::File::open(std::env::args().nth(1).unwrap()).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let row = reader.get_row_iter(None).unwrap().next().unwrap().unwrap();
    let found: Vec<&Field> = row.get_column_iter().map(|(_, field)| field).collect();
    println!("{found:?}");
    let as_said = [
        &Field::TimestampMillis(1_000),
        &Field::TimestampMillis(1_000),
        &Field::TimestampMicros(1_000_000),
        &Field::Long(1_000_000_000),
    ];
    std::process::exit(i32::from(found != as_said));
}
RUST
cd "$folder" && echo "parquet 60.1.0" && cargo run --quiet -- "$folder/times.parquet"
