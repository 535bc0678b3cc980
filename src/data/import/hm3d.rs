//! Segment names of an HM3D-Sem scene, from `<scene>.semantic.txt`.
//!
//! The format follows habitat-sim (`src/esp/scene/HM3DSemanticScene.cpp`): the first line is `HM3D Semantic
//! Annotations`, then one line per segment, `id,colour,"name",region`. A name is all text between the quotes and may
//! contain commas.

use std::collections::BTreeMap;

use crate::labels::names::class_of;
use crate::types::SegmentName;

const HEAD: &str = "HM3D Semantic Annotations";

/// Parses the names of segments, by number. Segments with an empty or unknown name are left out. Names without a known
/// class are counted in `unlisted`.
///
/// # Errors
/// If a line is invalid: its number, and the problem.
pub(super) fn parse(
    text: &str,
    unlisted: &mut BTreeMap<String, usize>,
) -> Result<BTreeMap<u32, SegmentName>, (usize, String)> {
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    match lines.next() {
        Some((_, head)) if head.trim() == HEAD => {}
        _ => return Err((1, format!("{HEAD:?} expected"))),
    }
    let mut names = BTreeMap::new();
    for (number, line) in lines {
        if line.trim().is_empty() {
            continue;
        }
        let wrong = |problem: &str| (number, format!("{problem} in id,colour,\"name\",region"));
        let mut parts = line.splitn(2, '"');
        let head = parts.next().unwrap_or_default();
        let (name, region) = parts
            .next()
            .and_then(|rest| rest.rsplit_once('"'))
            .ok_or_else(|| wrong("a name between quotes expected"))?;
        let id: u32 = head
            .split(',')
            .next()
            .unwrap_or_default()
            .trim()
            .parse()
            .map_err(|_| wrong("a whole number expected as id"))?;
        let region: i64 =
            region.trim_start_matches(',').trim().parse().map_err(|_| wrong("a whole number expected as region"))?;
        let Some(canonical) = class_of(name, name, 1, unlisted) else {
            continue;
        };
        let segment = SegmentName { name: name.to_owned(), canonical: canonical.to_owned(), region: Some(region) };
        if names.insert(id, segment).is_some() {
            return Err((number, format!("the segment {id} is defined twice")));
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_have_commas_and_be_empty() {
        let text = "HM3D Semantic Annotations\n1,00FF7F,\"Night stand\",0\n\n2,AA0000,\"books, magazines\",-1\n3,BB,\"\",4\n4,CC,\"unknown\",4\n5,DD,\"flux capacitor\",2\n";
        let mut unlisted = BTreeMap::new();
        let names = parse(text, &mut unlisted).unwrap();
        assert_eq!(names.keys().copied().collect::<Vec<_>>(), [1, 2, 5]);
        assert_eq!((names[&1].canonical.as_str(), names[&1].region), ("chest_of_drawers", Some(0)));
        assert_eq!(names[&2].name, "books, magazines");
        assert_eq!(names[&5].canonical, "misc");
        assert_eq!(unlisted.into_keys().collect::<Vec<_>>(), ["books, magazines", "flux capacitor"]);
    }

    #[test]
    fn errors_name_the_invalid_line() {
        for (text, line, message) in [
            ("", 1, "HM3D Semantic"),
            ("id,colour\n", 1, "HM3D Semantic"),
            ("HM3D Semantic Annotations\n1,FF,name,0\n", 2, "between quotes"),
            ("HM3D Semantic Annotations\nx,FF,\"bed\",0\n", 2, "as id"),
            ("HM3D Semantic Annotations\n1,FF,\"bed\"\n", 2, "as region"),
            ("HM3D Semantic Annotations\n1,FF,\"bed\",0\n1,FE,\"bed\",0\n", 3, "segment 1 is defined twice"),
        ] {
            let (found, problem) = parse(text, &mut BTreeMap::new()).unwrap_err();
            assert!(found == line && problem.contains(message), "{found}: {problem}");
        }
    }
}
