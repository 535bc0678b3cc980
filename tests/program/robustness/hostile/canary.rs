//! A folder beside the working folder that the program has no business with: it must stay as it is, and nothing of it
//! may be sent.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_eval::Digest;
use image::{Rgb, RgbImage};

use crate::support::image_files::png;

/// A word that stands in no other file.
pub(crate) const SECRET: &str = "canary-4f1c93d07b";

/// A size that no other image of the campaign has.
const SIZE: (u32, u32) = (23, 29);

/// The folder as it was made.
pub(crate) struct Canary {
    folder: PathBuf,
    state: Vec<Entry>,
}

#[derive(Debug, PartialEq)]
struct Entry {
    path: PathBuf,
    digest: Option<Digest>,
    changed: Option<SystemTime>,
}

impl Canary {
    /// Makes the folder `canary` in a folder.
    pub(crate) fn make(parent: &Path) -> Self {
        let folder = parent.join("canary");
        fs::create_dir_all(folder.join("inner")).unwrap();
        fs::write(folder.join("picture.png"), picture()).unwrap();
        // A last line without an end, which a careless reader of logs takes away.
        let text = format!("first line\n{SECRET}");
        fs::write(folder.join("private.txt"), &text).unwrap();
        fs::write(folder.join("inner/records.jsonl"), text).unwrap();
        let state = entries(&folder);
        Self { folder, state }
    }

    /// Changes since the canary was created.
    pub(crate) fn change(&self) -> Option<String> {
        let now = entries(&self.folder);
        let is_new = |entry: &&Entry| !self.state.contains(entry);
        let is_gone = |entry: &&Entry| !now.contains(entry);
        let other = now.iter().find(is_new).or(self.state.iter().find(is_gone));
        other.map(|entry| format!("{}", entry.path.display()))
    }
}

/// Every file and folder below a folder, in order.
fn entries(folder: &Path) -> Vec<Entry> {
    let mut all = Vec::new();
    let read = fs::read_dir(folder).into_iter().flatten().flatten();
    for path in read.map(|entry| entry.path()) {
        let meta = fs::symlink_metadata(&path).ok();
        if path.is_dir() {
            all.extend(entries(&path));
        }
        all.push(Entry {
            digest: fs::read(&path).ok().map(|bytes| Digest::from_bytes(&bytes)),
            changed: meta.and_then(|meta| meta.modified().ok()),
            path,
        });
    }
    all.sort_by(|one, other| one.path.cmp(&other.path));
    all
}

/// A picture of its own size and pixels.
fn picture() -> Vec<u8> {
    let (width, height) = SIZE;
    png(&RgbImage::from_fn(width, height, |x, y| Rgb([(x * 11) as u8, (y * 8) as u8, 201])))
}

/// Whether bytes that were sent hold the word or the picture of the folder, as it is or as it was made anew.
pub(crate) fn is_in(sent: &[u8]) -> bool {
    let holds = |part: &[u8]| sent.windows(part.len()).any(|window| window == part);
    let has_picture = || {
        let text = String::from_utf8_lossy(sent);
        let decoded = text.split(";base64,").skip(1).map(|rest| {
            let is_code = |c: &char| c.is_ascii_alphanumeric() || "+/=".contains(*c);
            let code: String = rest.chars().take_while(is_code).collect();
            STANDARD.decode(code).unwrap_or_default()
        });
        let size = |bytes: Vec<u8>| {
            let reader = image::ImageReader::new(std::io::Cursor::new(bytes));
            let reader = reader.with_guessed_format().ok()?;
            reader.into_dimensions().ok()
        };
        decoded.into_iter().any(|bytes| size(bytes) == Some(SIZE))
    };
    holds(SECRET.as_bytes()) || has_picture()
}

#[test]
fn the_picture_is_known_again() {
    let sent = |bytes: &[u8]| {
        let code = STANDARD.encode(bytes);
        format!("{{\"url\": \"data:image/png;base64,{code}\"}}").into_bytes()
    };
    assert!(is_in(&sent(&picture())));
    assert!(is_in(format!("line: {SECRET}.").as_bytes()));
    assert!(!is_in(&sent(&png(&RgbImage::new(24, 29)))));
}
