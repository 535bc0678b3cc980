//! Holds the code to the map in the crate documentation: which room may use which, and where each library stands.

mod circles;
mod controls;
mod digests;
mod files;
mod map;
mod rules;
mod source;
mod unsafe_code;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use files::Files;
use map::Map;
use source::Kind;

/// The rooms behind the names at the root of the program, and behind the names of crates that stand within a room.
const ALIASES: [(&str, &str); 3] = [("cli", "commands"), ("rooms", "data"), ("store", "runs")];

/// The folders of the other crates of the workspace, in `src/`.
const MEMBERS: [&str; 14] = [
    "ask/",
    "base/",
    "data/",
    "data/rooms/",
    "engine/",
    "enhance/",
    "light/",
    "light/python/",
    "pictures/",
    "questions/",
    "report/",
    "runs/",
    "runs/store/",
    "score/",
];

/// The libraries that the program uses in some places (folders or files in `src/`) alone. Test code may use them
/// anywhere.
const LIBRARIES: [(&str, &[&str]); 11] = [
    ("anstream", &["commands/cli"]),
    ("hyper", &["ask", "commands/serve"]),
    ("saphyr_parser", &["data/ready_made/container"]),
    ("noto_sans_mono_bitmap", &["report/charts/sheet"]),
    ("comfy_table", &["report/text"]),
    ("terminal_size", &["report/text"]),
    ("unicode_width", &["report/text"]),
    ("tokio", &["ask", "engine", "engine/images/image_pipeline.rs", "commands/serve"]),
    ("reqwest", &["ask"]),
    ("tiff", &["commands/calibrate/mosaic", "pictures/image_file/cmyk_tiff.rs"]),
    ("parquet", &["data/ready_made/container", "runs/store/column_file"]),
];

/// The places where a future may be awaited. Test code may await anywhere.
const AWAITS: [&str; 3] = ["ask", "engine", "commands/serve"];

/// The most lines of code that a file may have, without comments and modules for tests.
const MOST_LINES: usize = 500;

/// The circles of files that may be, each with its reason, or with how to cut it.
const CIRCLES: [(&[&str], &str); 1] = [(
    &["base/types/records/trials/mod.rs", "base/types/records/trials/trial_ref.rs"],
    "it stays: a trial is read through the tables of all, which hand it out",
)];

/// Folders with the code that reads the data sets of strangers, which may hold links to any file.
const DATA_READERS: [&str; 3] = ["data", "engine/images/frames", "commands/openeqa"];

/// The files among them that list folders or open files without `dataset::Root`, each with its reason.
const LISTING_FILES: [(&str, &str); 7] = [
    ("data/root.rs", "it checks them, and looks for similar names for its messages"),
    ("data/frames.rs", "whether a folder is empty, or has an image, of folders that Root let pass"),
    ("data/ready_made/container/tree.rs", "asks Root about each link"),
    ("data/ready_made/container/find.rs", "asks Root about each file"),
    ("data/import/files.rs", "folders that passed Root::refuse_links_out"),
    ("data/import/folder.rs", "folders that passed Root::refuse_links_out"),
    ("data/import/lerobot.rs", "names of tables, which Root checks before they are read"),
];

/// The functions that make a digest, and use debug output in what they tell the user alone.
const DEBUG_IN_MESSAGES: [(&str, &str); 3] = [
    ("commands/questions/mod.rs", "measure_frame"),
    ("commands/serve/mod.rs", "answer"),
    ("base/types/values/mod.rs", "from_str"),
];

/// The files of the program, read once for all tests.
static FILES: LazyLock<Files> = LazyLock::new(|| Files::read(&src()));

/// The files of the other crates.
static MEMBER_FILES: LazyLock<Vec<Files>> =
    LazyLock::new(|| MEMBERS.iter().map(|member| Files::read(&src().join(member)).below(member)).collect());

/// The files of each crate.
fn crates() -> impl Iterator<Item = &'static Files> {
    std::iter::once(&*FILES).chain(&*MEMBER_FILES)
}

/// The texts outside of tests in folders or files of `src/`, given by the start of their paths, each with its file and
/// line.
pub(crate) fn texts(places: &[&str]) -> Vec<(String, String)> {
    crates()
        .flat_map(Files::parts_outside_tests)
        .filter(|(_, part)| matches!(part.kind, Kind::Text))
        .filter(|(source, _)| places.iter().any(|place| source.path.starts_with(place)))
        .map(|(source, part)| (format!("src/{}:{}", source.path, part.line), part.names.concat()))
        .collect()
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn the_map() -> Map {
    let lib = fs::read_to_string(src().join("lib.rs")).unwrap();
    Map::read(&lib).unwrap_or_else(|problem| panic!("{problem}"))
}

/// Fails with everything that is wrong.
#[track_caller]
fn assert_none(wrong: &[String]) {
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn map_has_rooms_of_src() {
    let members = MEMBERS.iter().filter_map(|member| member.split('/').next());
    assert_none(&the_map().untrue(&FILES.rooms().into_iter().chain(members).collect()));
}

#[test]
fn rooms_use_only_what_map_allows() {
    let map = the_map();
    let mut wrong = rules::imports(&FILES, &map, &ALIASES);
    for member in &*MEMBER_FILES {
        wrong.extend(rules::crate_imports(member, &map, &ALIASES));
    }
    assert_none(&wrong);
}

/// What several commands need is in `engine` or below.
#[test]
fn no_command_uses_another() {
    assert_none(&rules::commands(&FILES));
}

#[test]
fn files_have_no_import_cycles() {
    assert_none(&circles::wrong(crates(), &CIRCLES));
}

#[test]
fn libraries_stand_in_their_places() {
    let found = LIBRARIES.iter().flat_map(|(name, places)| rules::library(crates(), name, places));
    assert_none(&found.collect::<Vec<_>>());
}

/// A file that a stranger's data set names, or a link in it, must not lead to a private file of the user.
#[test]
fn data_are_listed_in_their_files() {
    let places: Vec<&str> = LISTING_FILES.iter().map(|(place, _)| *place).collect();
    assert_none(&rules::listings(crates(), &DATA_READERS, &places));
}

#[test]
fn futures_are_awaited_in_their_places() {
    assert_none(&rules::awaits(crates(), &AWAITS));
}

/// Each stands there with its number and its reason, so that a new one is seen by who reads the page.
#[test]
fn security_page_lists_unsafe_code() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join(".github/SECURITY.md");
    let listed = unsafe_code::listed(&fs::read_to_string(page).unwrap());
    let counts = crates().flat_map(Files::iter).filter_map(|source| {
        let text = fs::read_to_string(src().join(&source.path)).unwrap();
        let count = unsafe_code::count(&text).unwrap();
        (count > 0).then(|| (source.path.clone(), count))
    });
    assert_eq!(listed, counts.collect());
}

#[test]
fn no_file_is_too_long() {
    let long = crates().flat_map(|files| rules::long_files(files, MOST_LINES));
    assert_none(&long.collect::<Vec<_>>());
}

#[test]
fn no_code_is_missing() {
    assert_none(&crates().flat_map(rules::unfinished).collect::<Vec<_>>());
}

/// Debug output has no promised form: a new field would change every digest that it enters.
#[test]
fn no_digest_uses_debug_output() {
    let makers: Vec<_> = crates().flat_map(digests::makers).collect();
    assert!(makers.len() > 20, "{makers:?}");
    let found: Vec<_> =
        makers.into_iter().filter(|(_, _, has_debug)| *has_debug).map(|(file, name, _)| (file, name)).collect();
    assert_eq!(found, DEBUG_IN_MESSAGES);
}
