//! Installation of the ONNX Runtime library from its PyPI wheel into the user's cache: [`install`].
//!
//! Integrity check of the installed library with a receipt: [`check`].
//!
//! The header of a library shows that it is complete ([`super::library_file`]), but not that its bytes are unchanged.
//! So a file next to the installed library records its SHA-256, size and time of modification. The library (29 MB) is
//! hashed again only if size or time differ from this receipt.

use std::env::consts;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use zip::ZipArchive;

use super::library_file::{LibraryFormat, PINNED};

/// The library in the wheel of version [`PINNED`] for one platform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pin {
    os: &'static str,
    arch: &'static str,
    /// Platform tag of the wheel.
    tag: &'static str,
    /// File name of the library, in `onnxruntime/capi/` of the wheel.
    file: &'static str,
    /// SHA-256 of the library, which is identical in the wheels for all versions of Python.
    sha256: &'static str,
}

/// The wheels of `onnxruntime==1.31.1` on PyPI.
const PINS: [Pin; 4] = [
    Pin {
        os: "linux",
        arch: "x86_64",
        tag: "manylinux_2_28_x86_64",
        file: "libonnxruntime.so.1.31.1",
        sha256: "fc44112fbe06d7d689c57e11d3862031f64711007e4ee020f8eed5185fd2c1d3",
    },
    Pin {
        os: "linux",
        arch: "aarch64",
        tag: "manylinux_2_28_aarch64",
        file: "libonnxruntime.so.1.31.1",
        sha256: "8aa3b76b28c778a2b1dd660d34161adb1d508c9ccd04ff9dc80e26eca5df8467",
    },
    Pin {
        os: "macos",
        arch: "aarch64",
        tag: "macosx_14_0_arm64",
        file: "libonnxruntime.1.31.1.dylib",
        sha256: "d586cbe89effc085a09d3341b3cfbd5c322517f9d397aeb20814af21433f2b36",
    },
    Pin {
        os: "windows",
        arch: "x86_64",
        tag: "win_amd64",
        file: "onnxruntime.dll",
        sha256: "e45f61e50d8650885452be538a00bb14a715e46a1bc3691000ce947e89ed0306",
    },
];

impl Pin {
    /// Pin for the platform of this build; `None` if no known wheel fits.
    pub(super) fn for_this_platform() -> Option<Self> {
        // The wheels need the GNU C library.
        if cfg!(target_env = "musl") {
            return None;
        }
        Self::for_platform(consts::OS, consts::ARCH)
    }

    /// True if a file has the name of the pinned library.
    pub(super) fn matches_name(self, path: &Path) -> bool {
        path.file_name().is_some_and(|name| name == self.file)
    }

    fn for_platform(os: &str, arch: &str) -> Option<Self> {
        PINS.into_iter().find(|pin| pin.os == os && pin.arch == arch)
    }
}

/// Commands that run pip, in the order in which they are tried.
const PIPS: [&[&str]; 4] = [&["python3", "-m", "pip"], &["pip3"], &["pip"], &["python", "-m", "pip"]];

/// Downloads the pinned wheel with pip, extracts the library, checks it and puts it into `folder`; returns its path.
///
/// The wheel is unpacked in a temporary folder next to `folder`, and the library is then moved in one step. So two
/// processes can install at once, and an interrupted installation leaves nothing that could be loaded.
///
/// # Errors
/// A message that names the step that failed.
pub(super) fn install(pin: Pin, folder: &Path) -> Result<PathBuf, String> {
    let parent = folder.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(|e| path_error(parent, "cannot be created", &e))?;
    let temporary = tempfile::Builder::new()
        .prefix("installing-")
        .tempdir_in(parent)
        .map_err(|e| path_error(parent, "cannot be written", &e))?;
    download(pin, temporary.path())?;
    let wheel = wheel_in(temporary.path())?;
    let unpacked = temporary.path().join(pin.file);
    unpack(&wheel, pin, &unpacked)?;
    let library = folder.join(pin.file);
    fs::create_dir_all(folder).map_err(|e| path_error(folder, "cannot be created", &e))?;
    match fs::rename(&unpacked, &library) {
        // Windows does not replace a library that another process has loaded; its content is the same.
        Err(_) if library.is_file() => {}
        Err(error) => return Err(path_error(&library, "cannot be written", &error)),
        Ok(()) => {}
    }
    check_installed(&library, pin).map_err(|e| format!("{} {e}", library.display()))?;
    Ok(library)
}

/// Checks that a library in the cache is the complete and unchanged pinned one.
///
/// # Errors
/// A message about the fault, to follow the library's path.
pub(super) fn check_installed(library: &Path, pin: Pin) -> Result<(), String> {
    LibraryFormat::for_this_system().check(library)?;
    check(library, pin.sha256)
}

/// Downloads the wheel into `folder` with the first available pip.
fn download(pin: Pin, folder: &Path) -> Result<(), String> {
    for pip in PIPS {
        match download_command(pip, pin, folder).output() {
            Ok(output) if output.status.success() => return Ok(()),
            Ok(output) if !is_missing(&output) => {
                return Err(format!("`{}` failed: {}", pip.join(" "), last_line(&output)));
            }
            // No such program, or a Python without pip: try the next one.
            Ok(_) | Err(_) => {}
        }
    }
    Err("there is no pip on PATH".to_owned())
}

/// Command that downloads the wheel with any version of Python.
fn download_command(pip: &[&str], pin: Pin, folder: &Path) -> Command {
    let mut command = Command::new(pip[0]);
    command
        .args(&pip[1..])
        .args(["download", "--no-deps", "--only-binary=:all:"])
        .args(["--implementation", "cp", "--python-version", "3.12"])
        .args(["--abi", "cp312", "--platform", pin.tag])
        .args(["--disable-pip-version-check", "--no-input", "--dest"])
        .arg(folder)
        .arg(format!("onnxruntime=={PINNED}"))
        .stdin(Stdio::null());
    command
}

/// True if the program, or pip in its Python, does not exist.
fn is_missing(output: &Output) -> bool {
    // 127 is the exit status of a shim (pyenv, asdf) for a program that does not exist.
    output.status.code() == Some(127) || String::from_utf8_lossy(&output.stderr).contains("No module named pip")
}

/// Last non-empty line of stdout and stderr, else the exit status.
fn last_line(output: &Output) -> String {
    [&output.stdout, &output.stderr]
        .map(|bytes| String::from_utf8_lossy(bytes))
        .iter()
        .flat_map(|text| text.lines())
        .rfind(|line| !line.trim().is_empty())
        .map_or_else(|| output.status.to_string(), |line| line.trim().to_owned())
}

fn wheel_in(folder: &Path) -> Result<PathBuf, String> {
    fs::read_dir(folder)
        .map_err(|e| path_error(folder, "cannot be read", &e))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .ok_or_else(|| "pip downloaded no wheel".to_owned())
}

/// Extracts the library from a wheel into `target`.
///
/// # Errors
/// If the wheel cannot be read, or its library is not the pinned one.
fn unpack(wheel: &Path, pin: Pin, target: &Path) -> Result<(), String> {
    let file = File::open(wheel).map_err(|e| unreadable_wheel(wheel, e))?;
    let mut archive = ZipArchive::new(file).map_err(|e| unreadable_wheel(wheel, e))?;
    let mut library =
        archive.by_name(&format!("onnxruntime/capi/{}", pin.file)).map_err(|e| unreadable_wheel(wheel, e))?;
    let mut hasher = Sha256::new();
    copy(&mut library, target, &mut hasher).map_err(|e| path_error(target, "cannot be written", &e))?;
    let found = hex(&hasher.finalize());
    if found == pin.sha256 {
        return Ok(());
    }
    Err(format!(
        "{} in the wheel that pip downloaded has the SHA-256 {found} instead of {}; it was not installed. Check pip's index and find-links settings (`pip config list`)",
        pin.file, pin.sha256
    ))
}

/// Copies `source` to a file, and feeds its bytes to the hasher.
fn copy(source: &mut impl Read, target: &Path, hasher: &mut Sha256) -> io::Result<()> {
    let mut file = File::create(target)?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        let length = source.read(&mut buffer)?;
        if length == 0 {
            return file.sync_all();
        }
        hasher.update(&buffer[..length]);
        file.write_all(&buffer[..length])?;
    }
}

fn unreadable_wheel(wheel: &Path, error: impl fmt::Display) -> String {
    format!("{}: {error}", wheel.display())
}

fn path_error(path: &Path, what: &str, error: &io::Error) -> String {
    format!("{} {what}: {error}", path.display())
}

/// Content of a receipt, a TOML file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Receipt {
    /// SHA-256 of the library, in hexadecimal digits.
    sha256: String,
    /// Size of the library in bytes.
    size: u64,
    /// Time of the last modification, in nanoseconds since 1970; `None` if the system does not record it.
    modified: Option<String>,
}

/// Path of a library's receipt: the library's path followed by `.receipt.toml`.
fn path_for(library: &Path) -> PathBuf {
    let mut path = library.as_os_str().to_owned();
    path.push(".receipt.toml");
    path.into()
}

impl Receipt {
    /// Receipt for a library with this SHA-256 and the present size and time of its file.
    fn for_library(library: &Path, sha256: String) -> io::Result<Self> {
        let metadata = fs::metadata(library)?;
        Ok(Self {
            sha256,
            size: metadata.len(),
            modified: metadata
                .modified()
                .ok()
                .and_then(|time| time.duration_since(UNIX_EPOCH).ok())
                .map(|since_1970| since_1970.as_nanos().to_string()),
        })
    }

    /// Writes the receipt next to its library. If that fails, the library is hashed at each start.
    fn write(&self, library: &Path) {
        let result =
            toml::to_string(self).map_err(io::Error::other).and_then(|text| fs::write(path_for(library), text));
        if let Err(e) = result {
            tracing::debug!("{} has no receipt: {e}", library.display());
        }
    }
}

/// Checks that an installed library has this SHA-256, and writes a missing or outdated receipt.
///
/// # Errors
/// A message about the fault, to follow the library's path.
pub(super) fn check(library: &Path, sha256: &str) -> Result<(), String> {
    let expected = Receipt::for_library(library, sha256.to_owned()).map_err(|e| format!("cannot be read: {e}"))?;
    let stored: Option<Receipt> =
        fs::read_to_string(path_for(library)).ok().and_then(|text| toml::from_str(&text).ok());
    if stored.as_ref() == Some(&expected) {
        return Ok(());
    }
    let found = hash(library).map_err(|e| format!("cannot be read: {e}"))?;
    if found != sha256 {
        return Err(format!("has changed since its installation: its SHA-256 is {found} instead of {sha256}"));
    }
    expected.write(library);
    Ok(())
}

/// SHA-256 of a file, in hexadecimal digits.
fn hash(path: &Path) -> io::Result<String> {
    let (mut file, mut hasher) = (File::open(path)?, Sha256::new());
    let mut buffer = vec![0; 1 << 16];
    loop {
        let length = file.read(&mut buffer)?;
        if length == 0 {
            return Ok(hex(&hasher.finalize()));
        }
        hasher.update(&buffer[..length]);
    }
}

/// Bytes in hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .flat_map(|byte| [byte >> 4, byte & 15])
        .filter_map(|digit| char::from_digit(digit.into(), 16))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use zip::write::SimpleFileOptions;

    use super::*;

    /// Writes a wheel with `content` as its library; returns the pin that it satisfies.
    fn wheel(path: &Path, name: &str, content: &[u8]) -> Pin {
        let mut writer = zip::ZipWriter::new(File::create(path).unwrap());
        let options = SimpleFileOptions::default();
        writer.start_file(format!("onnxruntime/capi/{name}"), options).unwrap();
        writer.write_all(content).unwrap();
        writer.finish().unwrap();
        let sha256 = hex(&Sha256::digest(content)).leak();
        Pin { sha256, ..PINS[0] }
    }

    #[test]
    fn pins_are_well_formed() {
        for pin in PINS {
            assert_eq!(pin.sha256.len(), 64);
            assert!(crate::libraries::library_file::is_library_name(pin.os, pin.file));
            assert!(pin.os == "windows" || pin.file.contains(PINNED));
            assert_eq!(Pin::for_platform(pin.os, pin.arch), Some(pin));
        }
        assert_eq!(Pin::for_platform("linux", "riscv64"), None);
    }

    #[test]
    fn only_the_pinned_library_is_unpacked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.whl");
        let target = folder.path().join("library");
        let content = vec![7; 100_000];
        let pin = wheel(&path, PINS[0].file, &content);
        assert_eq!(unpack(&path, pin, &target), Ok(()));
        assert_eq!(fs::read(&target).unwrap(), content);
        let problem = unpack(&path, PINS[0], &target).unwrap_err();
        assert!(problem.contains("it was not installed"), "{problem}");
        wheel(&path, "other.so", &[7]);
        assert!(unpack(&path, pin, &target).is_err());
        fs::write(&path, "not a zip").unwrap();
        assert!(unpack(&path, pin, &target).is_err());
    }

    #[cfg(unix)]
    fn run_shell(script: &str) -> Output {
        Command::new("sh").args(["-c", script]).output().unwrap()
    }

    #[cfg(unix)]
    #[test]
    fn last_line_of_pip_is_reported() {
        let failed = run_shell("echo Looking; echo 'ERROR: none found' >&2; echo >&2; exit 1");
        assert_eq!(last_line(&failed), "ERROR: none found");
        assert!(!is_missing(&failed));
        assert_eq!(last_line(&run_shell("exit 3")), "exit status: 3");
        assert!(is_missing(&run_shell("echo \"$0: No module named pip\" >&2; exit 1")));
    }

    /// Writes a library and sets the time of its modification.
    fn write_at(library: &Path, content: &[u8], time: SystemTime) {
        fs::write(library, content).unwrap();
        let file = File::options().write(true).open(library).unwrap();
        file.set_modified(time).unwrap();
    }

    #[test]
    fn library_is_hashed_again_only_if_size_or_time_differ() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libonnxruntime.so.1.31.1");
        fs::write(&library, [7; 1000]).unwrap();
        let sha256 = hex(&Sha256::digest([7; 1000]));
        assert_eq!(check(&library, &sha256), Ok(()));
        let receipt = fs::read_to_string(path_for(&library)).unwrap();
        assert!(receipt.contains(&sha256) && receipt.contains("1000"), "{receipt}");
        // Other bytes go unnoticed while size and time match the receipt.
        let time = fs::metadata(&library).unwrap().modified().unwrap();
        write_at(&library, &[8; 1000], time);
        assert_eq!(check(&library, &sha256), Ok(()));
        write_at(&library, &[8; 999], time);
        assert!(check(&library, &sha256).unwrap_err().contains("has changed"));
        let later = time + std::time::Duration::from_secs(9);
        write_at(&library, &[7; 1000], later);
        // If only the time differs, the receipt is updated.
        assert_eq!(check(&library, &sha256), Ok(()));
        assert_ne!(fs::read_to_string(path_for(&library)).unwrap(), receipt);
    }

    #[test]
    fn invalid_receipt_counts_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("library");
        fs::write(&library, "library").unwrap();
        fs::write(path_for(&library), "size = [").unwrap();
        assert!(check(&library, "other").is_err());
        assert_eq!(check(&library, &hex(&Sha256::digest("library"))), Ok(()));
        assert!(check(&folder.path().join("missing"), "other").is_err());
    }
}
