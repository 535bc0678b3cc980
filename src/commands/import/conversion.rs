//! Commands that convert recordings of other formats, and video in messages: [`conversion`], [`video_commands`].

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use darkqa_base::files::{entries, open};
use darkqa_base::types::shell_word;
use darkqa_data::import::recording::Encoding;

/// Kind of a file or folder, by its first bytes or the files in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RecordingKind {
    Ros1Bag,
    SqliteBag,
    Mcap,
    /// A file compressed with zstd as a whole.
    Compressed,
}

/// What `path` is and the commands that make it readable; `None` if it is an MCAP recording or unknown.
pub(super) fn conversion(path: &Path) -> Option<String> {
    match kind(path)? {
        RecordingKind::Ros1Bag => Some(format!("bags of ROS 1 are not read; {}", bag_commands(&[path.to_owned()]))),
        RecordingKind::SqliteBag => {
            Some(format!("bags of ROS 2 in SQLite are not read; {}", bag_commands(&sqlite_sources(path))))
        }
        RecordingKind::Compressed => Some(compressed(path)),
        RecordingKind::Mcap => None,
    }
}

/// The problem of a path that `import rosbag` cannot help with.
pub(super) fn not_a_bag(path: &Path) -> String {
    if kind(path) == Some(RecordingKind::Mcap) {
        let name = word(path);
        return format!("an MCAP recording; no conversion is needed: darkqa-eval import mcap {name}");
    }
    "neither a bag of ROS 1 (.bag) or ROS 2 (.db3) nor an MCAP recording".to_owned()
}

fn kind(path: &Path) -> Option<RecordingKind> {
    if path.is_dir() {
        let files = entries(path).ok()?;
        return [
            ("mcap", RecordingKind::Mcap),
            ("db3", RecordingKind::SqliteBag),
            ("zstd", RecordingKind::Compressed),
            ("zst", RecordingKind::Compressed),
        ]
        .into_iter()
        .find(|(ending, _)| files.iter().any(|file| has_ending(file, ending)))
        .map(|(_, kind)| kind);
    }
    let mut start = Vec::new();
    open(path).ok()?.take(8).read_to_end(&mut start).ok()?;
    match &*start {
        start if start.starts_with(b"#ROSBAG") => Some(RecordingKind::Ros1Bag),
        start if start.starts_with(b"SQLite f") => Some(RecordingKind::SqliteBag),
        start if start.starts_with(b"\x89MCAP") => Some(RecordingKind::Mcap),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Some(RecordingKind::Compressed),
        _ => None,
    }
}

fn has_ending(file: &Path, ending: &str) -> bool {
    file.extension().is_some_and(|own| own == ending)
}

/// What `rosbags-convert` takes for a bag in SQLite: its folder if `metadata.yaml` is in it, else each file.
fn sqlite_sources(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        let files = entries(path).unwrap_or_default();
        if files.iter().any(|file| file.ends_with("metadata.yaml")) {
            return vec![path.to_owned()];
        }
        let mut bags: Vec<PathBuf> = files.into_iter().filter(|file| has_ending(file, "db3")).collect();
        bags.sort();
        return bags;
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if folder.join("metadata.yaml").is_file() {
        return vec![folder.to_owned()];
    }
    vec![path.to_owned()]
}

/// The commands that convert bags into MCAP recordings and import them.
fn bag_commands(sources: &[PathBuf]) -> String {
    let mut commands = "convert it, which changes no image:\n  pip install rosbags\n".to_owned();
    let mut made = Vec::new();
    for source in sources {
        let (old, new) = (word(source), word(&converted(source)));
        let _ = writeln!(commands, "  rosbags-convert --src {old} --dst {new} --dst-storage mcap");
        made.push(new);
    }
    let _ = write!(commands, "  darkqa-eval import mcap {}", made.join(" "));
    commands
}

/// The folder that a conversion makes, which must not exist yet.
fn converted(source: &Path) -> PathBuf {
    let stem = source.with_extension("");
    if stem != source && !stem.exists() {
        return stem;
    }
    let name = source.file_stem().unwrap_or_default().to_string_lossy();
    let name = if name.is_empty() { "bag" } else { &name };
    let names = std::iter::once(format!("{name}-mcap")).chain((2..).map(|number| format!("{name}-mcap-{number}")));
    names
        .map(|name| match source.file_name() {
            Some(_) => source.with_file_name(name),
            None => source.join(name),
        })
        .find(|folder| !folder.exists())
        .unwrap_or(stem)
}

/// The commands for a file compressed as a whole, or a folder with such files.
fn compressed(path: &Path) -> String {
    let files = if path.is_dir() {
        let mut files = entries(path).unwrap_or_default();
        files.retain(|file| has_ending(file, "zstd") || has_ending(file, "zst"));
        files.sort();
        files
    } else {
        vec![path.to_owned()]
    };
    let mut words = "compressed as a whole; unpack it first:\n".to_owned();
    for file in &files {
        let new = unpacked(file);
        let (file, new) = (word(file), word(&new));
        let _ = writeln!(words, "  zstd -d {file} -o {new}");
    }
    let next = if path.is_dir() { path.to_owned() } else { unpacked(path) };
    let _ = write!(words, "  darkqa-eval import mcap {}", word(&next));
    words
}

/// The name of an unpacked file: without the ending of its compression.
fn unpacked(file: &Path) -> PathBuf {
    if has_ending(file, "zstd") || has_ending(file, "zst") {
        file.with_extension("")
    } else {
        file.with_added_extension("mcap")
    }
}

/// The commands that make a video of the messages of a topic, and import it. `rate` is the number of its messages per
/// second; `None` if it is unknown. `None` if no program is known that reads such messages.
pub(super) fn video_commands(files: &[PathBuf], topic: &str, encoding: Encoding, rate: Option<f64>) -> Option<String> {
    let (package, module) = match encoding {
        Encoding::Cdr => ("mcap-ros2-support", "mcap_ros2"),
        Encoding::Ros1 => ("mcap-ros1-support", "mcap_ros1"),
        Encoding::Protobuf => ("mcap-protobuf-support", "mcap_protobuf"),
        Encoding::Json => return None,
    };
    let script = format!(
        "import sys; from mcap.reader import make_reader as r; from {module}.decoder import DecoderFactory as D; [sys.stdout.buffer.write(bytes(m[3].data)) for f in sys.argv[2:] for m in r(open(f, \"rb\"), decoder_factories=[D()]).iter_decoded_messages([sys.argv[1]])]"
    );
    let script = shell_word(&script);
    let files: Vec<String> = files.iter().map(|file| word(file)).collect();
    let (files, topic) = (files.join(" "), shell_word(topic));
    let rate = rate.map_or(String::new(), |rate| format!("-r {rate:.3} "));
    Some(format!(
        "make a video of its messages, with their mean rate:\n  pip install {package}\n  python3 -c {script} {topic} {files} > video.raw\n  ffmpeg {rate}-i video.raw -c copy video.mp4\n  darkqa-eval import video video.mp4 --every 2 --out frames"
    ))
}

fn word(path: &Path) -> String {
    shell_word(&path.to_string_lossy()).into_owned()
}
