//! Presets for well-known sets that need more than the general rules: [`Preset`].

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use super::cells::Table;
use super::columns::map::Map;
use super::columns::names::plain;
use super::groups::columns;
use super::settings::{LeaveOut, SetArgs, SeveralImages};

/// The file of presets.
const SETS: &str = include_str!("sets.toml");

/// The rules of one set.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Preset {
    pub(super) title: String,
    pub(super) cite: String,
    recognise: Vec<String>,
    map: Option<String>,
    config: Option<String>,
    /// Templates of groups, of which the first whose columns are there counts.
    #[serde(default)]
    group: Vec<String>,
    #[serde(default)]
    skip: Vec<Skip>,
    rotations: Option<Rotations>,
}

/// A kind of rows that is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Skip {
    MultiImage,
    NoImage,
    Open,
    Several,
}

/// Rows that repeat a question with its options in another order.
#[derive(Debug, Deserialize)]
struct Rotations {
    column: String,
    above: u64,
}

/// The presets by name. A test holds that the file can be read.
static PRESETS: LazyLock<BTreeMap<String, Preset>> =
    LazyLock::new(|| toml::from_str(SETS).unwrap_or_default());

/// Whether there are rules for a set of this name.
pub(in crate::dataset) fn is_known(name: &str) -> bool {
    PRESETS.contains_key(name)
}

/// The names of all presets.
pub(in crate::dataset) fn names() -> Vec<&'static str> {
    PRESETS.keys().map(String::as_str).collect()
}

/// The preset of a name; `None` without one.
pub(super) fn named(name: Option<&str>) -> Option<&'static Preset> {
    PRESETS.get(name?)
}

/// The sentence for a set whose columns are those of a preset that was not named.
pub(super) fn recognised(columns: &[String], named: Option<&str>) -> Option<String> {
    if named.is_some() {
        return None;
    }
    let columns: Vec<String> = columns.iter().map(|column| plain(column)).collect();
    let mut presets = PRESETS
        .iter()
        .filter(|(_, preset)| !preset.recognise.is_empty());
    let (name, preset) =
        presets.find(|(_, preset)| preset.recognise.iter().all(|name| columns.contains(name)))?;
    Some(format!(
        "it looks like {}: --data {name}:FILE reads it by its rules",
        preset.title
    ))
}

impl Preset {
    /// The set and its paper, for messages.
    pub(super) fn source(&self) -> String {
        format!("read by the rules of {}: {}", self.title, self.cite)
    }

    /// The flags of the user, with those of the preset where the user gives none.
    pub(super) fn beneath(&self, args: &SetArgs) -> SetArgs {
        let mut args = args.clone();
        let map = self.map.as_deref().and_then(|map| map.parse::<Map>().ok());
        args.map.splice(0..0, map);
        args.preset_config.clone_from(&self.config);
        let skip = |kind, flag: Option<LeaveOut>| {
            flag.or(self.skip.contains(&kind).then_some(LeaveOut::Skip))
        };
        let skips_several = self.skip.contains(&Skip::MultiImage);
        let several = skips_several.then_some(SeveralImages::Skip);
        args.multi_image = args.multi_image.or(several);
        args.no_image = skip(Skip::NoImage, args.no_image);
        args.open = skip(Skip::Open, args.open);
        args.several = skip(Skip::Several, args.several);
        args
    }

    /// The groups of the set's own strict score as a map, and what is said if its columns are not there.
    pub(super) fn group(&self, table: &Table) -> (Option<Map>, Option<String>) {
        let is_there = |template: &&String| {
            columns(template)
                .iter()
                .all(|name| table.find(name).is_some())
        };
        let map = self.group.iter().find(is_there);
        let map = map.and_then(|template| format!("group={template}").parse().ok());
        let none = map.is_none() && !self.group.is_empty();
        let said = none.then(|| {
            format!(
                "no groups: {} scores questions together by {}, which are not among its columns; --map group=COLUMN names another",
                self.title,
                self.group.join(" or ")
            )
        });
        (map, said)
    }

    /// Whether a row repeats a question with its options in another order.
    pub(super) fn is_rotation(&self, table: &Table, row: usize) -> bool {
        let Some(rotations) = &self.rotations else {
            return false;
        };
        let cell = table
            .find(&rotations.column)
            .and_then(|column| table.rows[row].cell(column).text());
        let number = cell.and_then(|text| text.trim().parse::<u64>().ok());
        number.is_some_and(|number| number > rotations.above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_can_be_used() {
        let presets: BTreeMap<String, Preset> = toml::from_str(SETS).unwrap();
        assert!(presets.len() >= 7);
        for (name, preset) in &presets {
            assert!(
                !preset.title.is_empty() && !preset.cite.is_empty(),
                "{name}"
            );
            assert!(
                preset
                    .map
                    .as_ref()
                    .is_none_or(|map| map.parse::<Map>().is_ok()),
                "{name}"
            );
            assert!(
                preset
                    .recognise
                    .iter()
                    .all(|column| plain(column) == *column),
                "{name}"
            );
        }
    }

    #[test]
    fn a_set_is_recognised_and_never_switched() {
        let columns = ["Index", "Question", "Options", "Correct Answer"].map(str::to_owned);
        assert!(
            recognised(&columns, None)
                .unwrap()
                .contains("--data mmvp:FILE")
        );
        assert_eq!(recognised(&columns, Some("mmvp")), None);
        assert_eq!(recognised(&columns[..3], None), None);
        assert!(is_known("mmvp") && !is_known("mmbnech"));
        assert!(names().contains(&"mmbench"));
    }

    #[test]
    fn the_user_wins_over_a_preset() {
        let preset = named(Some("mmvp")).unwrap();
        let args = SetArgs {
            map: vec!["image=other/{Index}.png".parse().unwrap()],
            ..SetArgs::default()
        };
        let both = preset.beneath(&args);
        let joined = Map::joined(&both.map);
        assert_eq!(joined.entries[0].columns, ["other/{Index}.png"]);
    }
}
