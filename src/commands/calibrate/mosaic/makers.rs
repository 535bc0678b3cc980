//! Recognition of RAW files of camera makers, which are not supported: [`problem`].

use std::path::Path;

use super::decoded::EXPORT;

/// Extensions of RAW files, by maker: Adobe, Canon, Nikon, Sony, Olympus, Panasonic, Fujifilm, Pentax, Samsung, Leica,
/// Hasselblad, Phase One, Sigma, Kodak, Minolta, Epson.
const EXTENSIONS: [&str; 24] = [
    "dng", "cr2", "cr3", "crw", "nef", "nrw", "arw", "srf", "sr2", "orf", "rw2", "raw", "raf", "pef", "srw", "rwl",
    "3fr", "fff", "iiq", "x3f", "dcr", "kdc", "mrw", "erf",
];

/// Error for a RAW file of a maker, with advice on exporting its mosaic; `None` for other files.
pub(super) fn problem(path: &Path, bytes: &[u8]) -> Option<String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let by_content = match bytes {
        [b'I', b'I', 42, 0, _, _, _, _, b'C', b'R', ..] => Some("cr2"),
        [_, _, _, _, b'f', b't', b'y', b'p', b'c', b'r', b'x', ..] => Some("cr3"),
        _ if bytes.starts_with(b"FUJIFILMCCD-RAW") => Some("raf"),
        _ => None,
    };
    let by_name = EXTENSIONS.into_iter().find(|known| extension == *known);
    let kind = by_content.or(by_name)?.to_ascii_uppercase();
    Some(message(&kind))
}

/// Error message for a RAW file of this kind.
pub(super) fn message(kind: &str) -> String {
    format!("a {kind} file, the RAW format of a camera, is not read; {EXPORT}")
}
