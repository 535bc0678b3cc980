//! Removal of keys from a downloaded file: [`remove_secrets`].

use std::fs;
use std::io::{self, BufRead as _, BufReader, BufWriter, Write as _};
use std::path::Path;

use crate::ask::secrets::Scrub;
use crate::files::{create_new, reading};

/// Removes keys from the JSON lines of a file. A file without keys is not rewritten.
pub(super) fn remove_secrets(path: &Path, scrub: &Scrub) -> io::Result<()> {
    if scrub.is_empty() || !has_secrets(path, scrub)? {
        return Ok(());
    }
    let cleaned = path.with_extension("cleaned");
    let mut out = BufWriter::new(create_new(&cleaned)?);
    for_each_line(path, |line| {
        let text = String::from_utf8_lossy(line).into_owned();
        out.write_all(scrub.json_line(text).as_bytes())
    })?;
    out.into_inner()?.sync_all()?;
    fs::rename(&cleaned, path)
}

/// True if a line of the file contains a key.
fn has_secrets(path: &Path, scrub: &Scrub) -> io::Result<bool> {
    let mut found = false;
    for_each_line(path, |line| {
        let text = String::from_utf8_lossy(line).into_owned();
        found = found || scrub.json_line(text.clone()) != text;
        Ok(())
    })?;
    Ok(found)
}

/// Calls `visit` with each line of a file, including its line end.
fn for_each_line(path: &Path, mut visit: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufReader::new(reading::open(path)?);
    let mut line = Vec::new();
    while file.read_until(b'\n', &mut line)? > 0 {
        visit(&line)?;
        line.clear();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rewritten(path: &Path, scrub: &Scrub, before: &[u8]) -> Vec<u8> {
        fs::write(path, before).unwrap();
        remove_secrets(path, scrub).unwrap();
        fs::read(path).unwrap()
    }

    #[test]
    fn only_keys_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.download");
        let scrub = Scrub::new(["sk-0123456789abcdef".to_owned()]);
        assert_eq!(
            rewritten(&path, &scrub, b"{\"a\": 1}\r\n\n{\"key\": \"sk-0123456789abcdef\"}"),
            b"{\"a\": 1}\r\n\n{\"key\": \"[secret]\"}"
        );
        // Parts of a key within one string are removed, but not across strings or in ids.
        assert_eq!(
            rewritten(
                &path,
                &scrub,
                br#"{"custom_id": "abc0123456789abcdef", "b": ["0123", "4567"], "c": "\u0030123 4567 89a"}"#
            ),
            br#"{"custom_id": "abc0123456789abcdef", "b": ["0123", "4567"], "c": "[secret]"}"#
        );
        let other = b"sk-01234\xff\n\n";
        assert_eq!(rewritten(&path, &scrub, other), other);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
