//! The functions that make a digest and write debug output.

use super::files::Files;
use super::source::{Kind, Part};

/// The functions of `Digest` that compute one.
const DIGEST_MAKERS: [&str; 5] = ["canonical", "canonical_value", "from_bytes", "from_parts", "from_file_digests"];

/// The functions that make a digest, by file and name, each with whether a text of it has debug output. Tests are left
/// out.
pub(crate) fn makers(files: &Files) -> Vec<(&str, &str, bool)> {
    let mut makers = Vec::new();
    for source in files.iter().filter(|source| !source.is_test) {
        let parts: Vec<&Part> = source.parts.iter().filter(|part| !part.in_test).collect();
        for function in parts.chunk_by(|_, next| !matches!(next.kind, Kind::Function)) {
            let is_function = matches!(function[0].kind, Kind::Function);
            if is_function && function.iter().any(|part| makes_digest(&part.names)) {
                let name = function[0].names.last().map_or("", String::as_str);
                let has_debug = function.iter().any(|part| is_debug(part));
                makers.push((source.path.as_str(), name, has_debug));
            }
        }
    }
    makers
}

fn makes_digest(path: &[String]) -> bool {
    match path {
        [.., kind, name] if kind == "Digest" => DIGEST_MAKERS.contains(&name.as_str()),
        [first, _, ..] => first == "blake3",
        _ => false,
    }
}

/// Whether a part is a text with a place for debug output, such as `{:?}` or `{name:#?}`.
fn is_debug(part: &Part) -> bool {
    let is_place = |rest: &str| {
        let place = rest.split_once('}').map_or("", |(place, _)| place);
        place.contains(':') && place.ends_with('?')
    };
    matches!(part.kind, Kind::Text) && part.names[0].split('{').skip(1).any(is_place)
}
