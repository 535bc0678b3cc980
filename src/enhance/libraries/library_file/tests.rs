//! Tests with libraries of a few hundred bytes.

use std::io::Cursor;

use super::*;

/// `size` zero bytes, overwritten by `parts` at their positions.
fn file(size: usize, parts: &[(usize, &[u8])]) -> Vec<u8> {
    let mut bytes = vec![0; size];
    for (at, part) in parts {
        bytes[*at..at + part.len()].copy_from_slice(part);
    }
    bytes
}

fn check(format: LibraryFormat, bytes: &[u8]) -> Result<(), String> {
    format.check_content(&mut Cursor::new(bytes), bytes.len() as u64, "x86_64")
}

/// An ELF library with a segment up to byte 300, names at 200, and a table of two sections from 320 to 448.
fn elf(names: &[u8]) -> Vec<u8> {
    let length = (names.len() as u64).to_le_bytes();
    file(
        448,
        &[
            (0, b"\x7fELF\x02\x01\x01"),
            (16, &[3, 0, 62, 0]),
            (32, &64_u64.to_le_bytes()),
            (40, &320_u64.to_le_bytes()),
            (54, &[56, 0, 1, 0, 64, 0, 2, 0]),
            (64 + 32, &300_u64.to_le_bytes()),
            (200, names),
            (384 + 4, &[3]),
            (384 + 8, &[2]),
            (384 + 24, &200_u64.to_le_bytes()),
            (384 + 32, &length),
        ],
    )
}

/// A Mach-O library whose one segment ends at byte 500.
fn mach_o() -> Vec<u8> {
    file(
        500,
        &[
            (0, &0xfeed_facf_u32.to_le_bytes()),
            (4, &0x0100_0007_u32.to_le_bytes()),
            (12, &[6, 0, 0, 0, 1, 0, 0, 0, 72, 0, 0, 0]),
            (32, &[0x19, 0, 0, 0, 72]),
            (32 + 40, &100_u64.to_le_bytes()),
            (32 + 48, &400_u64.to_le_bytes()),
        ],
    )
}

/// A PE library whose one section ends at byte 512.
fn pe() -> Vec<u8> {
    file(
        512,
        &[
            (0, b"MZ"),
            (0x3c, &[64]),
            (64, b"PE\0\0"),
            (68, &[0x64, 0x86, 1, 0]),
            (84, &[16]),
            (86, &[0, 0x20]),
            (64 + 24 + 16 + 16, &256_u32.to_le_bytes()),
            (64 + 24 + 16 + 20, &256_u32.to_le_bytes()),
        ],
    )
}

#[test]
fn complete_libraries_pass_and_truncated_ones_are_refused() {
    let universal = [
        file(
            64,
            &[
                (0, &[0xca, 0xfe, 0xba, 0xbe, 0, 0, 0, 1]),
                (8, &0x0100_0007_u32.to_be_bytes()),
                (16, &64_u32.to_be_bytes()),
                (20, &500_u32.to_be_bytes()),
            ],
        ),
        mach_o(),
    ]
    .concat();
    for (format, library) in [
        (LibraryFormat::Elf, elf(ENTRY)),
        (LibraryFormat::MachO, mach_o()),
        (LibraryFormat::MachO, universal),
        (LibraryFormat::Pe, pe()),
    ] {
        assert_eq!(check(format, &library), Ok(()), "{format:?}");
        let whole = library.len();
        for length in [whole - 1, whole - 50, 150, 60, 30, 8, 0] {
            let problem = check(format, &library[..length]).unwrap_err();
            let expected = format!("is incomplete: {length} ");
            assert!(problem.starts_with(&expected), "{format:?}: {problem}");
        }
        let problem = check(format, &library[..whole - 1]).unwrap_err();
        let expected = format!("{} of {whole} bytes", whole - 1);
        assert!(problem.contains(&expected), "{problem}");
    }
}

#[test]
fn other_files_and_processors_are_refused() {
    let text = [b' '; 600];
    for format in [LibraryFormat::Elf, LibraryFormat::MachO, LibraryFormat::Pe] {
        let problem = check(format, &text).unwrap_err();
        assert!(problem.contains("not a dynamic library"), "{problem}");
    }
    for (format, library) in
        [(LibraryFormat::Elf, elf(ENTRY)), (LibraryFormat::MachO, mach_o()), (LibraryFormat::Pe, pe())]
    {
        let size = library.len() as u64;
        let checked = format.check_content(&mut Cursor::new(&library), size, "aarch64");
        assert!(checked.unwrap_err().contains("another processor"));
    }
    // ET_EXEC: a program instead of a library.
    let mut program = elf(ENTRY);
    program[16] = 2;
    assert!(check(LibraryFormat::Elf, &program).is_err());
    let problem = check(LibraryFormat::Elf, &elf(b"RegisterCustomOps\0")).unwrap_err();
    assert!(problem.contains("OrtGetApiBase"), "{problem}");
}

#[test]
fn huge_offsets_cause_no_panic() {
    for at in [32, 40, 64 + 8, 64 + 32] {
        let mut library = elf(ENTRY);
        library[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
        let problem = check(LibraryFormat::Elf, &library).unwrap_err();
        assert!(problem.contains("is incomplete"), "{problem}");
    }
}

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
    let libc =
        loaded.lines().filter_map(|line| line.split_whitespace().nth(5)).find(|path| path.contains("libc.so")).unwrap();
    let problem = probe(Path::new(libc)).unwrap_err();
    assert!(problem.contains("OrtGetApiBase"), "{problem}");
}
