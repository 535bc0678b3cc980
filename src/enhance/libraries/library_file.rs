//! Check that the file of a library is complete, before it is loaded: [`LibraryFormat::check`].
//!
//! The system's loader maps a library without checking its length: a library without its last megabyte kills the
//! program with SIGBUS, and one without its last 4,096 bytes may load or not. So the size that the header implies is
//! compared with the size of the file. Sources of the offsets: the ELF specification (gabi, chapters 4 and 5), Apple's
//! `mach-o/loader.h` and `mach-o/fat.h`, and Microsoft's "PE Format".
//!
//! Check of a candidate for the ONNX Runtime library, and its version: [`probe`].

#[cfg(test)]
mod tests;

use std::env::consts;
use std::error::Error as _;
use std::ffi::CStr;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::SystemTime;

use libloading::{Library, Symbol};
use ort::sys::OrtApiBase;

/// Format of dynamic libraries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LibraryFormat {
    /// Linux and most other systems.
    Elf,
    /// macOS.
    MachO,
    /// Windows.
    Pe,
}

/// Maximum number of load commands, segments, sections or architectures that are read; chosen (the ONNX Runtime library
/// has fewer than 50).
const MAX_PARTS: u64 = 4096;

/// Symbol that only the ONNX Runtime library exports.
const ENTRY: &[u8] = b"OrtGetApiBase\0";

/// Maximum size, in bytes, of a table of dynamic names that is searched for [`ENTRY`]; chosen (that of ONNX Runtime has
/// 30 kB).
const MAX_NAMES: u64 = 16 << 20;

impl LibraryFormat {
    /// Format of the operating system of this build.
    pub(super) fn for_this_system() -> Self {
        match consts::OS {
            "windows" => Self::Pe,
            "macos" => Self::MachO,
            _ => Self::Elf,
        }
    }

    /// Checks that a file is a complete library for this build's processor, and that no other process is writing it.
    ///
    /// # Errors
    /// A message about the fault, to follow the library's path.
    pub(super) fn check(self, path: &Path) -> Result<(), String> {
        let mut file = File::open(path).map_err(|e| format!("cannot be read: {e}"))?;
        let before = size_and_time(&file)?;
        self.check_content(&mut file, before.0, consts::ARCH)?;
        if size_and_time(&file)? != before {
            return Err("is being written by another process; wait until it is complete".to_owned());
        }
        Ok(())
    }

    /// Checks a library of `size` bytes for a processor (named as in [`std::env::consts::ARCH`]).
    fn check_content(self, file: &mut (impl Read + Seek), size: u64, arch: &str) -> Result<(), String> {
        let mut header = Header { file, start: 0 };
        let needed = match self {
            Self::Elf => header.elf(arch),
            Self::MachO => header.mach_o(arch),
            Self::Pe => header.pe(arch),
        };
        match needed {
            Ok(needed) if needed <= size => Ok(()),
            Ok(needed) => Err(incomplete_message(&format!("{size} of {needed} bytes"))),
            Err(HeaderError::Truncated) => {
                Err(incomplete_message(&format!("{size} bytes, fewer than its header states")))
            }
            Err(HeaderError::Invalid(problem)) => Err(problem.to_owned()),
            Err(HeaderError::Unreadable(e)) => Err(format!("cannot be read: {e}")),
        }
    }
}

/// Size of a file in bytes, and the time of its last modification if the system records it.
fn size_and_time(file: &File) -> Result<(u64, Option<SystemTime>), String> {
    let metadata = file.metadata().map_err(|e| format!("cannot be read: {e}"))?;
    Ok((metadata.len(), metadata.modified().ok()))
}

/// Message about an incomplete file.
fn incomplete_message(sizes: &str) -> String {
    format!("is incomplete: {sizes}; copy or install it again, or wait if another process is still writing it")
}

/// Error in the header of a library.
enum HeaderError {
    /// The file ends within its header.
    Truncated,
    /// The file is not a library that this build can load.
    Invalid(&'static str),
    Unreadable(std::io::Error),
}

const NOT_A_LIBRARY: HeaderError = HeaderError::Invalid("is not a dynamic library of this system");
const OTHER_PROCESSOR: HeaderError = HeaderError::Invalid("is a library for another processor");

/// Header of a library that starts at byte `start` of a file.
struct Header<'a, F> {
    file: &'a mut F,
    start: u64,
}

impl<F: Read + Seek> Header<'_, F> {
    fn bytes<const N: usize>(&mut self, at: u64) -> Result<[u8; N], HeaderError> {
        let mut bytes = [0; N];
        let at = self.start.checked_add(at).ok_or(HeaderError::Truncated)?;
        let result = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut bytes));
        match result {
            Ok(()) => Ok(bytes),
            Err(e) if matches!(e.kind(), ErrorKind::UnexpectedEof | ErrorKind::InvalidInput) => {
                Err(HeaderError::Truncated)
            }
            Err(e) => Err(HeaderError::Unreadable(e)),
        }
    }

    fn u16(&mut self, at: u64) -> Result<u64, HeaderError> {
        self.bytes(at).map(|b| u64::from(u16::from_le_bytes(b)))
    }

    fn u32(&mut self, at: u64) -> Result<u64, HeaderError> {
        self.bytes(at).map(|b| u64::from(u32::from_le_bytes(b)))
    }

    fn u64(&mut self, at: u64) -> Result<u64, HeaderError> {
        self.bytes(at).map(u64::from_le_bytes)
    }

    /// Minimum size of an ELF library: the end of its last table or segment. ONNX Runtime's releases end with the
    /// section table, so even one missing byte is detected.
    fn elf(&mut self, arch: &str) -> Result<u64, HeaderError> {
        // Magic, 64 bits, little-endian; ET_DYN is 3.
        if self.bytes::<6>(0)? != *b"\x7fELF\x02\x01" || self.u16(16)? != 3 {
            return Err(NOT_A_LIBRARY);
        }
        let machine = match arch {
            "x86_64" => Some(62),
            "aarch64" => Some(183),
            _ => None,
        };
        let found = self.u16(18)?;
        if machine.is_some_and(|machine| machine != found) {
            return Err(OTHER_PROCESSOR);
        }
        let (segments, sections) = (self.u64(32)?, self.u64(40)?);
        let [segment_size, segment_count] = [self.u16(54)?, self.u16(56)?];
        let [section_size, section_count] = [self.u16(58)?, self.u16(60)?];
        let mut needed = end_offset(segments, segment_size * segment_count)?
            .max(end_offset(sections, section_size * section_count)?);
        for index in 0..segment_count.min(MAX_PARTS) {
            let segment = end_offset(segments, index * segment_size)?;
            needed = needed.max(end_offset(self.u64(segment + 8)?, self.u64(segment + 32)?)?);
        }
        let size = self.file.seek(SeekFrom::End(0)).map_err(HeaderError::Unreadable)?;
        if needed <= size && section_count > 0 {
            self.check_exported_entry(sections, section_size, section_count.min(MAX_PARTS))?;
        }
        Ok(needed)
    }

    /// Checks that the table of dynamic names of an ELF library (SHT_STRTAB with SHF_ALLOC) contains [`ENTRY`]. Other
    /// libraries, such as those of custom operators, must not be loaded, because that would run their initialisers.
    fn check_exported_entry(&mut self, sections: u64, size: u64, count: u64) -> Result<(), HeaderError> {
        for index in 0..count {
            let section = end_offset(sections, index * size)?;
            let is_table = self.u32(section + 4)? == 3 && self.u64(section + 8)? & 2 != 0;
            let [offset, length] = [self.u64(section + 24)?, self.u64(section + 32)?];
            if !is_table || length > MAX_NAMES {
                continue;
            }
            let mut names = vec![0; usize::try_from(length).map_err(|_| HeaderError::Truncated)?];
            self.file
                .seek(SeekFrom::Start(offset))
                .and_then(|_| self.file.read_exact(&mut names))
                .map_err(HeaderError::Unreadable)?;
            if !names.windows(ENTRY.len()).any(|name| name == ENTRY) {
                return Err(HeaderError::Invalid("is not ONNX Runtime: it exports no OrtGetApiBase"));
            }
        }
        Ok(())
    }

    /// Minimum size of a Mach-O library: the end of its last segment, or of the part for this processor in a universal
    /// file.
    fn mach_o(&mut self, arch: &str) -> Result<u64, HeaderError> {
        // CPU_TYPE_X86_64 and CPU_TYPE_ARM64.
        let cpu = match arch {
            "x86_64" => 0x0100_0007,
            _ => 0x0100_000c,
        };
        if self.bytes(0)? == [0xca, 0xfe, 0xba, 0xbe] {
            return self.universal(cpu);
        }
        self.mach_o_part(cpu)
    }

    /// Minimum size, from the start of the file, of a Mach-O library for one processor.
    fn mach_o_part(&mut self, cpu: u64) -> Result<u64, HeaderError> {
        // MH_MAGIC_64; MH_DYLIB is 6.
        if self.u32(0)? != 0xfeed_facf || self.u32(12)? != 6 {
            return Err(NOT_A_LIBRARY);
        }
        if self.u32(4)? != cpu {
            return Err(OTHER_PROCESSOR);
        }
        let (count, mut at) = (self.u32(16)?.min(MAX_PARTS), 32);
        let mut needed = end_offset(at, self.u32(20)?)?;
        for _ in 0..count {
            let (command, length) = (self.u32(at)?, self.u32(at + 4)?);
            // LC_SEGMENT_64
            if command == 0x19 {
                needed = needed.max(end_offset(self.u64(at + 40)?, self.u64(at + 48)?)?);
            }
            at = end_offset(at, length.max(8))?;
        }
        end_offset(self.start, needed)
    }

    /// Minimum size of a universal Mach-O file, whose header is big-endian.
    fn universal(&mut self, cpu: u64) -> Result<u64, HeaderError> {
        let count = u64::from(u32::from_be_bytes(self.bytes(4)?)).min(MAX_PARTS);
        for index in 0..count {
            let part = 8 + 20 * index;
            if u64::from(u32::from_be_bytes(self.bytes(part)?)) == cpu {
                let start = u64::from(u32::from_be_bytes(self.bytes(part + 8)?));
                let length = u64::from(u32::from_be_bytes(self.bytes(part + 12)?));
                let mut inner = Header { file: &mut *self.file, start };
                return Ok(inner.mach_o_part(cpu)?.max(end_offset(start, length)?));
            }
        }
        Err(OTHER_PROCESSOR)
    }

    /// Minimum size of a PE library: the end of the raw data of its last section.
    fn pe(&mut self, arch: &str) -> Result<u64, HeaderError> {
        if self.bytes(0)? != *b"MZ" {
            return Err(NOT_A_LIBRARY);
        }
        let at = self.u32(0x3c)?;
        // IMAGE_FILE_DLL is 0x2000.
        if self.bytes(at)? != *b"PE\0\0" || self.u16(at + 22)? & 0x2000 == 0 {
            return Err(NOT_A_LIBRARY);
        }
        let machine = match arch {
            "x86_64" => Some(0x8664),
            "aarch64" => Some(0xaa64),
            _ => None,
        };
        let found = self.u16(at + 4)?;
        if machine.is_some_and(|machine| machine != found) {
            return Err(OTHER_PROCESSOR);
        }
        let sections = at + 24 + self.u16(at + 20)?;
        let mut needed = 0;
        for index in 0..self.u16(at + 6)?.min(MAX_PARTS) {
            let section = sections + 40 * index;
            needed = needed.max(end_offset(self.u32(section + 20)?, self.u32(section + 16)?)?);
        }
        Ok(needed)
    }
}

/// Offset of the end of a part of a file. A part that ends beyond 2^64 counts as truncated.
fn end_offset(start: u64, length: u64) -> Result<u64, HeaderError> {
    start.checked_add(length).ok_or(HeaderError::Truncated)
}

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
