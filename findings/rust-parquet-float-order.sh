#!/usr/bin/env bash
# A file of the Rust crate parquet 60 with one float column cannot be read by Polars before 1.43.
#
# Guess: any reader reads it, as the default settings write the oldest features, and a footer may hold what a reader does
# not know.
# Seen with parquet 60.1.0 and Polars 1.42.1 and 1.43.2: a column of doubles has the order IEEE754_TOTAL_ORDER in the
# footer, a new case of a union, at which Polars 1.42.1 refuses the whole file ("Invalid thrift" or "ColumnOrder union");
# 1.43.2 reads it. A file with a column of integers alone, and the same file by parquet 59.3.2, are read by both. DuckDB
# 0.10.3, pyarrow 14.0.2 and fastparquet 2024.11.0 read all of them. No setting of the writer leaves the order out.
# Builds two small programs with cargo.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/main.rs" <<'RUST'
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::sync::Arc;

fn main() {
    let folder = std::env::args().nth(1).unwrap();
    for kind in ["double", "int64"] {
        let schema = parse_message_type(&format!("message rows {{ required {kind} x; }}")).unwrap();
        let file = File::create(format!("{folder}/{kind}.parquet")).unwrap();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer = SerializedFileWriter::new(file, Arc::new(schema), properties).unwrap();
        let mut rows = writer.next_row_group().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        match kind {
            "double" => column.typed::<DoubleType>().write_batch(&[0.5, 1.5], None, None).unwrap(),
            _ => column.typed::<Int64Type>().write_batch(&[1, 2], None, None).unwrap(),
        };
        column.close().unwrap();
        rows.close().unwrap();
        writer.close().unwrap();
    }
}
RUST
for version in 60.1.0 59.3.2; do
    mkdir -p "$folder/$version/src"
    cp "$folder/main.rs" "$folder/$version/src/main.rs"
    cat > "$folder/$version/Cargo.toml" <<TOML
[package]
name = "probe"
version = "0.1.0"
edition = "2021"
[dependencies]
parquet = { version = "=$version", default-features = false, features = ["snap"] }
TOML
    (cd "$folder/$version" && CARGO_TARGET_DIR="$folder/target" cargo run --quiet -- "$folder/$version")
done
found=""
for polars in 1.42.1 1.43.2; do
    python3 -m venv "$folder/venv-$polars"
    "$folder/venv-$polars/bin/pip" install --quiet --disable-pip-version-check "polars==$polars"
    for file in 60.1.0/double 60.1.0/int64 59.3.2/double 59.3.2/int64; do
        result=$("$folder/venv-$polars/bin/python" - "$folder/$file.parquet" <<'PYTHON'
import sys

import polars

try:
    print("read", polars.read_parquet(sys.argv[1])["x"].to_list())
except Exception as error:
    print("refused:", str(error).splitlines()[0])
PYTHON
        )
        echo "Polars $polars, parquet $file: $result"
        found="$found ${result%% *}"
    done
done
[ "$found" = " refused: read read read read read read read" ]
