//! Check of a candidate for the ONNX Runtime library, and its version: [`probe`].

use std::error::Error as _;
use std::ffi::CStr;
use std::path::Path;

use libloading::{Library, Symbol};
use ort::sys::OrtApiBase;

use super::library_file::LibraryFormat;

/// Version that is installed if no library is found; its checksums are in `install.rs`.
pub(crate) const PINNED: &str = "1.31.1";

/// Oldest usable minor version 1.x: the lowest version of the C API that the `ort` crate supports.
pub(super) const OLDEST: u32 = ort::MINOR_VERSION;

/// True if a file has the name of the ONNX Runtime library on an operating system (named as in
/// [`std::env::consts::OS`]).
pub(super) fn is_library_name(os: &str, name: &str) -> bool {
    match os {
        "windows" => name.eq_ignore_ascii_case("onnxruntime.dll"),
        "macos" => {
            name.starts_with("libonnxruntime.")
                && Path::new(name).extension().is_some_and(|extension| extension == "dylib")
        }
        _ => name == "libonnxruntime.so" || name.starts_with("libonnxruntime.so."),
    }
}

/// Checks a library's file, loads it, gets its version and unloads it; returns the version.
///
/// Only complete libraries that export ONNX Runtime's entry point are loaded, so libraries of custom operators are not.
/// The API is requested here already, because `ort` panics if a library does not provide it.
///
/// # Errors
/// A message about the fault, to follow the library's path.
pub(super) fn probe(path: &Path) -> Result<String, String> {
    let metadata = std::fs::metadata(path).map_err(|e| format!("cannot be read: {e}"))?;
    if !metadata.is_file() {
        return Err("is not a file; name the library itself".to_owned());
    }
    LibraryFormat::for_this_system().check(path)?;
    let version = version_of(path)?;
    match minor(&version) {
        Some(minor) if minor >= OLDEST => Ok(version),
        Some(_) => Err(format!("is version {version}, but 1.{OLDEST} or later is needed")),
        None => Err(format!("has version {version:?}; expected 1.x")),
    }
}

/// Minor version `x` of version `1.x.y`.
fn minor(version: &str) -> Option<u32> {
    let mut parts = version.split('.');
    parts.next().filter(|major| *major == "1")?;
    parts.next()?.parse().ok()
}

/// Loads a library and returns the version that its API states.
#[expect(unsafe_code, reason = "a dynamic library can be asked for its version in no other way")]
fn version_of(path: &Path) -> Result<String, String> {
    // SAFETY: loading runs the library's initialisers. The file has the name of the ONNX Runtime library, or the user
    // asked for it to be loaded; ONNX Runtime's initialisers have no preconditions.
    let library = unsafe { Library::new(path) }.map_err(|e| {
        // The loader's message is in the source of the error.
        let reason = e.source().map_or_else(|| e.to_string(), ToString::to_string);
        format!("cannot be loaded: {reason}")
    })?;
    // SAFETY: a symbol of this name has had this type, `const OrtApiBase* OrtGetApiBase(void)`, in every release of
    // ONNX Runtime's C API since 1.0; it takes nothing and may be called at any time.
    let base = unsafe {
        let get: Symbol<unsafe extern "system" fn() -> *const OrtApiBase> =
            library.get(b"OrtGetApiBase").map_err(|_| "is not ONNX Runtime: it exports no OrtGetApiBase".to_owned())?;
        get()
    };
    // SAFETY: if it is not null, it points to a static of the library, which stays loaded to the end of this function.
    let Some(base) = (unsafe { base.as_ref() }) else {
        return Err("provides no API".to_owned());
    };
    // SAFETY: both functions may be called at any time; the version is a static string that ends with a zero.
    let (version, api) = unsafe {
        let version = (base.GetVersionString)();
        let version = (!version.is_null()).then(|| CStr::from_ptr(version).to_string_lossy());
        (version.unwrap_or_default().into_owned(), (base.GetApi)(ort::sys::ORT_API_VERSION))
    };
    // For a library that is too old, the caller's error about its version is clearer.
    if api.is_null() && minor(&version).is_none_or(|minor| minor >= OLDEST) {
        return Err(format!("is version {version} but does not provide API {OLDEST}"));
    }
    Ok(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_are_recognised_by_name() {
        for (os, name, expected) in [
            ("linux", "libonnxruntime.so", true),
            ("linux", "libonnxruntime.so.1.31.1", true),
            ("linux", "libonnxruntime_providers_shared.so", false),
            ("linux", "libonnxruntime.dylib", false),
            ("macos", "libonnxruntime.1.31.1.dylib", true),
            ("macos", "libonnxruntime_providers.dylib", false),
            ("windows", "onnxruntime.dll", true),
            ("windows", "onnxruntime_providers_shared.dll", false),
        ] {
            assert_eq!(is_library_name(os, name), expected, "{os} {name}");
        }
    }

    #[test]
    fn minor_versions_are_parsed() {
        assert_eq!(minor("1.31.1"), Some(31));
        assert_eq!(minor("1.17.0-dev"), Some(17));
        for wrong in ["", "1", "2.1.0", "1.x", "one"] {
            assert_eq!(minor(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn files_that_are_not_libraries_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let text = folder.path().join("libonnxruntime.so");
        std::fs::write(&text, "not a library").unwrap();
        for (path, part) in [
            (folder.path().join("missing.so"), "cannot be read"),
            (folder.path().to_owned(), "is not a file"),
            (text, "is not a dynamic library"),
        ] {
            let problem = probe(&path).unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn other_libraries_are_refused() {
        let loaded = std::fs::read_to_string("/proc/self/maps").unwrap();
        let libc = loaded
            .lines()
            .filter_map(|line| line.split_whitespace().nth(5))
            .find(|path| path.contains("libc.so"))
            .unwrap();
        let problem = probe(Path::new(libc)).unwrap_err();
        assert!(problem.contains("OrtGetApiBase"), "{problem}");
    }
}
