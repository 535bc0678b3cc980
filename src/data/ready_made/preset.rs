//! Presets for well-known sets that need more than the general rules: [`Preset`].

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;

use super::cells::SetRows;
use super::columns::map::ColumnMap;
use super::groups::template_columns;
use super::settings::{LeaveOut, SetArgs, SeveralImages};
use crate::ready_made::columns::map::normalize;

/// Presets in TOML.
const SETS: &str = include_str!("sets.toml");

/// Rules to read a well-known set.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Preset {
    pub(super) title: String,
    pub(super) cite: String,
    /// Normalized names of columns by which the set is recognized; empty if it is not.
    recognise: Vec<String>,
    map: Option<String>,
    config: Option<String>,
    /// Templates of groups. The first one whose columns exist is used.
    #[serde(default)]
    group: Vec<String>,
    #[serde(default)]
    skip: Vec<Skip>,
    rotations: Option<Rotations>,
}

/// Kind of rows to leave out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Skip {
    MultiImage,
    NoImage,
    Open,
    Several,
}

/// Column that marks copies of a question with its options in another order: its number is above `above`.
#[derive(Debug, Deserialize)]
struct Rotations {
    column: String,
    above: u64,
}

/// Presets by name. A test checks that the file can be parsed.
static PRESETS: LazyLock<BTreeMap<String, Preset>> = LazyLock::new(|| toml::from_str(SETS).unwrap_or_default());

/// True if a preset has this name.
pub(crate) fn is_known(name: &str) -> bool {
    PRESETS.contains_key(name)
}

/// Names of all presets.
pub(crate) fn names() -> Vec<&'static str> {
    PRESETS.keys().map(String::as_str).collect()
}

/// The preset with this name.
pub(super) fn find(name: &str) -> Option<&'static Preset> {
    PRESETS.get(name)
}

/// Suggests the preset of a set that has these columns; `None` if no preset has them.
pub(super) fn recognition_hint(columns: &[String]) -> Option<String> {
    let columns: Vec<String> = columns.iter().map(|column| normalize(column)).collect();
    let (name, preset) = PRESETS.iter().find(|(_, preset)| {
        let names = &preset.recognise;
        !names.is_empty() && names.iter().all(|name| columns.contains(name))
    })?;
    Some(format!("it looks like {}: --data {name}:FILE reads it by its rules", preset.title))
}

impl Preset {
    /// Title and paper of the set, for messages.
    pub(super) fn source(&self) -> String {
        format!("read by the rules of {}: {}", self.title, self.cite)
    }

    /// Fills in the flags that the user does not give.
    pub(super) fn complete(&self, args: &SetArgs) -> SetArgs {
        let mut args = args.clone();
        let map = self.map.as_deref().and_then(|map| map.parse().ok());
        args.map.splice(0..0, map);
        args.preset_config.clone_from(&self.config);
        if args.multi_image.is_none() && self.skip.contains(&Skip::MultiImage) {
            args.multi_image = Some(SeveralImages::Skip);
        }
        args.no_image = args.no_image.or(self.skipped(Skip::NoImage));
        args.open = args.open.or(self.skipped(Skip::Open));
        args.several = args.several.or(self.skipped(Skip::Several));
        args
    }

    fn skipped(&self, kind: Skip) -> Option<LeaveOut> {
        self.skip.contains(&kind).then_some(LeaveOut::Skip)
    }

    /// Map of the groups for the strict score of the set, or a note if their columns do not exist.
    pub(super) fn group(&self, table: &SetRows) -> (Option<ColumnMap>, Option<String>) {
        let map: Option<ColumnMap> = self
            .group
            .iter()
            .find(|template| template_columns(template).iter().all(|name| table.find(name).is_some()))
            .and_then(|template| format!("group={template}").parse().ok());
        let is_missing = map.is_none() && !self.group.is_empty();
        let note = is_missing.then(|| {
            format!(
                "no groups: {} scores questions together by {}, which are not among its columns; --map group=COLUMN names another",
                self.title,
                self.group.join(" or ")
            )
        });
        (map, note)
    }

    /// True if a row is a copy of a question with its options in another order.
    pub(super) fn is_rotation(&self, table: &SetRows, row: usize) -> bool {
        let Some(rotations) = &self.rotations else {
            return false;
        };
        table
            .find(&rotations.column)
            .and_then(|column| table.rows[row].cell(column).text())
            .and_then(|text| text.trim().parse::<u64>().ok())
            .is_some_and(|number| number > rotations.above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid() {
        let presets: BTreeMap<String, Preset> = toml::from_str(SETS).unwrap();
        assert!(presets.len() >= 7);
        for (name, preset) in &presets {
            assert!(!preset.title.is_empty() && !preset.cite.is_empty(), "{name}");
            assert!(preset.map.as_ref().is_none_or(|map| map.parse::<ColumnMap>().is_ok()), "{name}");
            assert!(preset.recognise.iter().all(|column| normalize(column) == *column), "{name}");
        }
    }

    #[test]
    fn set_is_recognized_by_its_columns() {
        let columns = ["Index", "Question", "Options", "Correct Answer"].map(str::to_owned);
        assert!(recognition_hint(&columns).unwrap().contains("--data mmvp:FILE"));
        assert_eq!(recognition_hint(&columns[..3]), None);
        assert!(is_known("mmvp") && !is_known("mmbnech"));
        assert!(names().contains(&"mmbench"));
    }

    #[test]
    fn user_flags_take_precedence() {
        let preset = find("mmvp").unwrap();
        let args = SetArgs { map: vec!["image=other/{Index}.png".parse().unwrap()], ..SetArgs::default() };
        let both = preset.complete(&args);
        let joined = ColumnMap::merge(&both.map);
        assert_eq!(joined.entries[0].columns, ["other/{Index}.png"]);
    }
}
