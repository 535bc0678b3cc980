//! Segment names and room types of a Matterport3D scene, from `<scene>.house`.
//!
//! The first word of a line is its type (Matterport `data_organization.md`): `C` is a category with its class in
//! mpcat40, `O` an object with its region and category, `R` a region with the letter of its room type. In names, `#`
//! represents a space.

use std::collections::{BTreeMap, BTreeSet};

use crate::labels::names::{UNKNOWN, class_override};
use crate::types::SegmentName;

/// Used content of a `.house` file.
#[derive(Debug, Default, PartialEq)]
pub(super) struct House {
    /// Names of segments, by number.
    pub(super) names: BTreeMap<u32, SegmentName>,
    /// Room type of each region, by its number.
    pub(super) rooms: BTreeMap<i64, &'static str>,
}

/// Room type for the letter of a region; `None` for room types that no question asks about.
fn room_type(letter: &str) -> Option<&'static str> {
    Some(match letter {
        "a" | "t" => "bathroom",
        "b" => "bedroom",
        "d" => "dining room",
        "f" | "l" => "living room",
        "j" => "laundry room",
        "k" => "kitchen",
        "o" => "office",
        _ => return None,
    })
}

/// Parses a `.house` file. Categories with a class that is not in `classes` get the class for unknown objects.
///
/// # Errors
/// If a line is invalid: its number, and the problem.
pub(super) fn parse(text: &str, classes: &BTreeSet<String>) -> Result<House, (usize, String)> {
    let mut categories: BTreeMap<&str, (String, String)> = BTreeMap::new();
    let mut objects = Vec::new();
    let mut house = House::default();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let short = || (number, format!("a line of {} words is too short", words.len()));
        match words.first() {
            Some(&"C") => {
                let [_, index, _, name, _, class, ..] = words[..] else {
                    return Err(short());
                };
                let name = name.replace('#', " ");
                let class = class_override(&name).unwrap_or(class);
                let class = if classes.contains(class) { class } else { UNKNOWN };
                categories.insert(index, (name, class.to_owned()));
            }
            Some(&"O") => {
                let [_, index, region, category, ..] = words[..] else {
                    return Err(short());
                };
                let index: u32 =
                    index.parse().map_err(|_| (number, format!("{index:?} is not the number of an object")))?;
                let region: i64 =
                    region.parse().map_err(|_| (number, format!("{region:?} is not the number of a region")))?;
                objects.push((index, region, category));
            }
            Some(&"R") => {
                let [_, index, _, _, _, letter, ..] = words[..] else {
                    return Err(short());
                };
                let index: i64 =
                    index.parse().map_err(|_| (number, format!("{index:?} is not the number of a region")))?;
                house.rooms.extend(room_type(letter).map(|room| (index, room)));
            }
            _ => {}
        }
    }
    for (index, region, category) in objects {
        if let Some((name, canonical)) = categories.get(category) {
            let name = SegmentName { name: name.clone(), canonical: canonical.clone(), region: Some(region) };
            house.names.insert(index, name);
        }
    }
    Ok(house)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::canonical;

    #[test]
    fn objects_have_categories_and_regions() {
        let text = "ASCII 1.1\nH x y 0 0\nR 0 0 0 0 b 1 2 3\nR 1 0 0 0 h 1 2 3\nC 4 12 coffee#table 5 table 0 0 0 0 0\nC 7 9 painting 39 objects 0 0 0 0 0\nC 8 9 thing 41 unlabeled 0\nO 0 0 4 1.0 2.0 3.0\nO 1 1 7 1 2 3\nO 2 1 -1 1 2 3\nO 3 1 8 0 0 0\n";
        let house = parse(text, &canonical()).unwrap();
        assert_eq!(house.rooms, [(0, "bedroom")].into());
        let names: Vec<(u32, &str, &str)> =
            house.names.iter().map(|(id, name)| (*id, name.name.as_str(), name.canonical.as_str())).collect();
        assert_eq!(names, [(0, "coffee table", "table"), (1, "painting", "picture"), (3, "thing", "misc")]);
        assert_eq!(parse("O 1", &canonical()).unwrap_err().0, 1);
        assert!(parse("\nO x 1 2", &canonical()).unwrap_err().1.contains("not the number of an object"));
    }
}
