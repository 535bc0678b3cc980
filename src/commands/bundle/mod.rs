//! `bundle`: packs a run into a ZIP file for sharing.
//!
//! The ZIP file of a bundle: [`zip_files`] and [`is_bundle`].

mod readme;
mod redact;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::io::{self, Cursor, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_report::joined::stamp::STAMP;
use darkqa_report::joined::whole_report;
use darkqa_runs::Outcome;
use darkqa_runs::record_table::RECORDS_PARQUET;
use darkqa_runs::stored::run_name;
use darkqa_store::INDEX;
use readme::{ReadmeInputs, command, readme};
use redact::{RedactedRun, Redactor};

pub(crate) use redact::ThumbnailChoice;

/// The flags of `bundle`.
#[derive(Debug, Args)]
pub(crate) struct BundleArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// Where the ZIP file goes; an existing bundle is replaced, any other file is not
    #[arg(long, value_name = "FILE.zip", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The small images in it
    #[arg(long, value_name = "WHICH", value_enum, default_value = "shown", add = Decides::Nothing)]
    pub thumbnails: ThumbnailChoice,
}

/// Packs a run. Paths, URLs and secrets are removed from all files, and the report is made again from the redacted
/// files.
///
/// # Errors
/// If the folder has no run, `--out` is an existing file other than a bundle, or private information would be left in a
/// file.
pub(crate) fn bundle(args: &BundleArgs) -> Result<Outcome> {
    let replaces = args.out.symlink_metadata().is_ok();
    if replaces && !is_bundle(&args.out) {
        let problem = "exists already and is not a bundle; name another file";
        return Err(Error::data(args.out.display(), problem));
    }
    let folder_name = file_name(&run_name(&args.run));
    let mut redactor = Redactor::new(&args.run);
    let RedactedRun { manifest, mut files, run, thumbnails } =
        RedactedRun::read(&args.run, &folder_name, args.thumbnails, &mut redactor)?;
    let command = command(&manifest, &run);
    let report = whole_report(run)?;
    files.extend(report.files);
    let mut changes: Vec<String> = redactor.changes.iter().map(|(change, times)| change.words(*times)).collect();
    if thumbnails[1] > 0 {
        let all = thumbnails[0] + thumbnails[1];
        changes.push(format!("{} of {all} small images are left out", thumbnails[1]));
    }
    let mut others = other_entries(&args.run, &files)?;
    // They are made again from the records.
    others.retain(|name| ![INDEX, STAMP].contains(&&**name));
    if let Some(table) = others.iter().position(|name| name == RECORDS_PARQUET) {
        // The table is not redacted.
        others.remove(table);
        changes.push(format!("{RECORDS_PARQUET} is left out: report writes it again, from records.jsonl"));
    }
    match others.len() {
        0 => {}
        1 => changes.push("1 other file or folder of the run is left out: no report needs it".to_owned()),
        n => changes.push(format!("{n} other files or folders of the run are left out: no report needs them")),
    }
    files.sort();
    let sizes: Vec<(String, usize)> = files.iter().map(|(name, content)| (name.clone(), content.len())).collect();
    let text = readme(&ReadmeInputs {
        name: &folder_name,
        command: &command,
        findings: &report.markdown,
        changes: &changes,
        files: &sizes,
    });
    files.push(("README.md".to_owned(), text.into_bytes()));
    check_leaks(&files, &redactor)?;
    let count = files.len() + 1;
    let archive = zip_files(&folder_name, files)?;
    files::write(&args.out, &archive)?;
    let verb = if replaces { "replaced" } else { "written" };
    let mut output = format!("{}: {verb}, {count} files, {} bytes\n", args.out.display(), archive.len());
    for change in changes {
        let _ = writeln!(output, "{change}");
    }
    if !others.is_empty() {
        let _ = writeln!(output, "left out: {}", others.join(", "));
    }
    Ok(Outcome::wrote(&args.out, Status::Complete, output))
}

/// Checks that no private information is left in any file.
fn check_leaks(files: &[(String, Vec<u8>)], redactor: &Redactor) -> Result<()> {
    for (name, content) in files {
        if let Some(what) = redactor.find_leak(&String::from_utf8_lossy(content)) {
            let place = leak_place(content, redactor);
            let problem = format_args!(
                "{what} would be in {place}; nothing is written. Please report this with that line of the run"
            );
            return Err(Error::data(name, problem));
        }
    }
    Ok(())
}

/// The first line of a file that contains private information, with the field of its JSON: `line 3, field
/// failure.message`.
fn leak_place(content: &[u8], redactor: &Redactor) -> String {
    let text = String::from_utf8_lossy(content);
    if let Some(field) = serde_json::from_str(&text).ok().and_then(|value| leaking_field(&value, redactor)) {
        return format!("the field {field}");
    }
    let leaking = text.lines().enumerate().find(|(_, line)| redactor.find_leak(line).is_some());
    let Some((index, line)) = leaking else {
        return "it".to_owned();
    };
    let field = serde_json::from_str(line).ok().and_then(|value| leaking_field(&value, redactor));
    let field = field.map_or_else(String::new, |field| format!(", field {field}"));
    format!("line {}{field}", index + 1)
}

/// The path of the first field whose text or name contains private information: `failure.message`. A name that does is
/// not shown.
fn leaking_field(value: &Value, redactor: &Redactor) -> Option<String> {
    let joined = |name: &str, inner: String| match inner.as_str() {
        "" => name.to_owned(),
        _ => format!("{name}.{inner}"),
    };
    match value {
        Value::String(text) => redactor.find_leak(text).map(|_| String::new()),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .find_map(|(index, item)| leaking_field(item, redactor).map(|inner| joined(&index.to_string(), inner))),
        Value::Object(fields) => fields.iter().find_map(|(name, item)| {
            if redactor.find_leak(name).is_some() {
                return Some("(a name of a field)".to_owned());
            }
            leaking_field(item, redactor).map(|inner| joined(name, inner))
        }),
        _ => None,
    }
}

/// Names of the entries of the run folder that are not in the bundle, sorted.
fn other_entries(folder: &Path, files: &[(String, Vec<u8>)]) -> Result<Vec<String>> {
    let known: BTreeSet<&str> = files.iter().map(|(name, _)| name.split('/').next().unwrap_or(name)).collect();
    let mut others = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))? {
        let name = entry.map_err(|e| Error::file(folder, "read", e))?.file_name();
        let name = name.to_string_lossy().into_owned();
        if !known.contains(&*name) {
            others.push(name);
        }
    }
    others.sort();
    Ok(others)
}

/// Converts the name of a run to a folder name that is valid on all systems.
fn file_name(name: &str) -> String {
    let name: String = name.chars().map(|c| if c.is_alphanumeric() || "-_.+@".contains(c) { c } else { '_' }).collect();
    match name.trim_start_matches('.') {
        "" => "run".to_owned(),
        name => name.to_owned(),
    }
}

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
fn is_bundle(path: &Path) -> bool {
    // The comment follows the end record, whose last two bytes are the length of the comment.
    read_end(path, END_RECORD + MARK.len()).is_ok_and(|end| end.starts_with(b"PK\x05\x06") && end.ends_with(MARK))
}

/// The last `length` bytes of a file.
fn read_end(path: &Path, length: usize) -> io::Result<Vec<u8>> {
    let mut file = files::open(path)?;
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
fn zip_files(folder: &str, mut files: Vec<(String, Vec<u8>)>) -> Result<Vec<u8>> {
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

    #[test]
    fn the_place_of_a_leak_is_named() {
        // The folder of the run is private.
        let redactor = Redactor::new(Path::new("/mnt/of-ann/run"));
        for (content, expected) in [
            (
                "{\"reply\":\"no\"}\n{\"reply\":\"no\",\"failure\":{\"message\":\"in /mnt/of-ann/run\"}}\n",
                "line 2, field failure.message",
            ),
            ("{\"a\": [\"no\", \"/mnt/of-ann/run\"]}", "the field a.1"),
            ("{\"/mnt/of-ann/run\": 1}", "the field (a name of a field)"),
            ("a,b\n1,/mnt/of-ann/run\n", "line 2"),
        ] {
            assert!(redactor.find_leak(content).is_some(), "{content}");
            assert_eq!(leak_place(content.as_bytes(), &redactor), expected);
        }
    }

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
