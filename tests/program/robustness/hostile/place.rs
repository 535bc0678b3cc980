//! What stands in the place of a file: a link, a pipe, a folder, nothing.

use std::fs;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::Command;

use crate::robustness::hostile::random::Random;

/// Something other than a regular file at the path of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    LinkTo(&'static str),
    /// A second name of a file of the canary folder.
    HardLink,
    Pipe,
    Folder,
    Nothing,
    Empty,
    /// The file, which nobody may read.
    Closed,
}

/// What a user may not have in the place of a file that the command line names. A pipe, a device and a link of the
/// user's own are read there.
const OF_TYPED: [Place; 5] = [Place::LinkTo("loop"), Place::Folder, Place::Nothing, Place::Empty, Place::Closed];

const ALL: [Place; 15] = [
    Place::LinkTo("CANARY/private.txt"),
    Place::LinkTo("CANARY/picture.png"),
    Place::LinkTo("CANARY/inner"),
    Place::LinkTo("CANARY/new.txt"),
    Place::LinkTo("CANARY/inner/records.jsonl"),
    Place::LinkTo("/dev/zero"),
    Place::LinkTo("/proc/self/environ"),
    Place::LinkTo("/proc/self/mem"),
    Place::LinkTo("loop"),
    Place::HardLink,
    Place::Pipe,
    Place::Folder,
    Place::Nothing,
    Place::Empty,
    Place::Closed,
];

impl Place {
    /// One of them; `is_typed` says whether the command line names the file.
    pub(crate) fn draw(random: &mut Random, is_typed: bool) -> Self {
        *random.pick(if is_typed { &OF_TYPED[..] } else { &ALL })
    }

    /// Puts it in the place of a file; `canary` is the canary folder.
    pub(crate) fn put(self, file: &Path, canary: &Path) {
        if self == Self::Closed {
            fs::set_permissions(file, fs::Permissions::from_mode(0o000)).unwrap();
            return;
        }
        fs::remove_file(file).unwrap();
        match self {
            Self::LinkTo("loop") => symlink(file, file).unwrap(),
            Self::LinkTo(target) => {
                symlink(target.replace("CANARY", &canary.to_string_lossy()), file).unwrap();
            }
            Self::HardLink => fs::hard_link(canary.join("private.txt"), file).unwrap(),
            Self::Pipe => {
                let made = Command::new("mkfifo").arg(file).status().unwrap();
                assert!(made.success());
            }
            Self::Folder => fs::create_dir(file).unwrap(),
            Self::Empty => fs::write(file, "").unwrap(),
            Self::Nothing | Self::Closed => {}
        }
    }
}
