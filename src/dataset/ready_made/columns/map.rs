//! Which column is which, as the user states: [`Map`].

use std::fmt;
use std::str::FromStr;

use super::names::Role;
use crate::dataset::ready_made::choices::Reading;
use crate::types::shell_word;

/// The value of `--map`: roles and their columns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Map {
    text: String,
    pub(in crate::dataset::ready_made) entries: Vec<Entry>,
}

/// One role of a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::dataset::ready_made) struct Entry {
    pub(super) role: Role,
    /// A column, several (cells of options, images) or a template with `{Column}`; none turns the role off.
    pub(in crate::dataset::ready_made) columns: Vec<String>,
    /// The same names as one, which holds commas if there are several: a column of that name goes first.
    pub(super) whole: String,
    pub(in crate::dataset::ready_made) how: How,
}

/// How the cells of a column are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::dataset::ready_made) enum How {
    /// By rule.
    ByRule,
    /// Options in one text, between these signs.
    Split(String),
    /// Answers by this reading.
    Answer(Reading),
}

/// A column for a role as a flag that a shell can read, with the reading of answers if one is named.
pub(in crate::dataset::ready_made) fn flag(
    role: Role,
    column: &str,
    reading: Option<Reading>,
) -> String {
    let how = match reading {
        Some(reading) => format!(":{}", reading.name()),
        // What follows the last colon is how the column is read: here, by rule.
        None if column.contains(':') && matches!(role, Role::Options | Role::Answer) => {
            ":".to_owned()
        }
        None => String::new(),
    };
    let value = format!("{column}{how}");
    format!("--map {}={}", role.name(), shell_word(&value))
}

impl Map {
    /// The maps as one. A later one wins over an earlier one, role by role.
    pub(in crate::dataset::ready_made) fn joined<'a>(
        maps: impl IntoIterator<Item = &'a Self>,
    ) -> Self {
        let mut joined = Self::default();
        for map in maps {
            for entry in &map.entries {
                joined.entries.retain(|known| known.role != entry.role);
                joined.entries.push(entry.clone());
            }
        }
        joined
    }

    /// The entry of a role.
    pub(in crate::dataset::ready_made) fn entry(&self, role: Role) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.role == role)
    }
}

impl fmt::Display for Map {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for Map {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let starts: Vec<usize> = starts(text);
        if starts.first() != Some(&0) {
            let roles = Role::ALL.map(Role::name).join(", ");
            return Err(format!(
                "role=column expected, with one of the roles {roles}"
            ));
        }
        let ends = starts[1..].iter().map(|start| start - 1);
        let parts = starts.iter().zip(ends.chain([text.len()]));
        let mut entries: Vec<Entry> = Vec::new();
        for (start, end) in parts {
            let entry = entry(&text[*start..end])?;
            if entries.iter().any(|known| known.role == entry.role) {
                return Err(format!("{} occurs twice", entry.role.name()));
            }
            entries.push(entry);
        }
        Ok(Self {
            text: text.to_owned(),
            entries,
        })
    }
}

/// Where the entries of a map begin: at its start, and behind commas before `role=`.
fn starts(text: &str) -> Vec<usize> {
    let commas = text.match_indices(',').map(|(at, _)| at + 1);
    let is_role = |at: &usize| {
        let rest = &text[*at..];
        rest.split_once('=')
            .is_some_and(|(name, _)| Role::ALL.iter().any(|role| role.name() == name.trim()))
    };
    std::iter::once(0).chain(commas).filter(is_role).collect()
}

fn entry(text: &str) -> Result<Entry, String> {
    let (name, value) = text.split_once('=').ok_or("role=column expected")?;
    let name = name.trim();
    let role = Role::ALL.into_iter().find(|role| role.name() == name);
    let role = role.ok_or_else(|| format!("no role {name:?}"))?;
    let (column, how) = match (role, value.rsplit_once(':')) {
        (Role::Options | Role::Answer, Some((column, ""))) => (column, How::ByRule),
        (Role::Options, Some((column, how))) => {
            let signs = how
                .strip_prefix("split(")
                .and_then(|how| how.strip_suffix(')'));
            let signs = signs.filter(|signs| !signs.is_empty());
            let signs =
                signs.ok_or("options=COLUMN:split(|) expected, with the signs between options")?;
            (column, How::Split(signs.to_owned()))
        }
        (Role::Answer, Some((column, how))) => {
            let reading = Reading::from_name(how);
            let reading = reading.ok_or_else(|| {
                let names = Reading::ALL.map(Reading::name).join(", ");
                format!("answer=COLUMN:HOW expected, with one of {names}")
            })?;
            (column, How::Answer(reading))
        }
        _ => (value, How::ByRule),
    };
    let several = matches!(role, Role::Options | Role::Image) && !column.contains('{');
    let columns = if column.is_empty() {
        Vec::new()
    } else if several {
        column
            .split(',')
            .map(|column| column.trim().to_owned())
            .collect()
    } else {
        vec![column.trim().to_owned()]
    };
    Ok(Entry {
        role,
        columns,
        whole: column.trim().to_owned(),
        how,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_names_columns_by_role() {
        let text = "id=nr,question=frage,image=pics/{bild}.png,options=auswahl:split(|),answer=richtig:index1,family=";
        let map: Map = text.parse().unwrap();
        assert_eq!(map.to_string(), text);
        let columns = |role| map.entry(role).unwrap().columns.clone();
        assert_eq!(columns(Role::Image), ["pics/{bild}.png"]);
        assert_eq!(columns(Role::Family), Vec::<String>::new());
        assert_eq!(
            map.entry(Role::Options).unwrap().how,
            How::Split("|".into())
        );
        assert_eq!(
            map.entry(Role::Answer).unwrap().how,
            How::Answer(Reading::Index1)
        );
        assert_eq!(map.entry(Role::Hint), None);
        let cells: Map = "options=first,second:x,third".parse().unwrap_or_default();
        assert_eq!(cells.entries, []);
        let cells: Map = "options=first,second,answer=truth".parse().unwrap();
        assert_eq!(
            cells.entry(Role::Options).unwrap().columns,
            ["first", "second"]
        );
        let comma: Map = "options=all:split(,)".parse().unwrap();
        assert_eq!(
            comma.entry(Role::Options).unwrap().how,
            How::Split(",".into())
        );
        let both = Map::joined([&map, &"id=,answer=x".parse().unwrap()]);
        assert_eq!(both.entry(Role::Id).unwrap().columns, Vec::<String>::new());
        assert_eq!(both.entry(Role::Question).unwrap().columns, ["frage"]);
    }

    #[test]
    fn a_wrong_map_is_refused_with_what_was_expected() {
        for (text, says) in [
            ("frage", "one of the roles question, image"),
            ("colour=frage", "one of the roles question, image"),
            ("id=a,id=b", "id occurs twice"),
            ("answer=a:second", "one of letter, text, index0, index1"),
            ("options=a:split()", "split(|) expected"),
        ] {
            let problem = text.parse::<Map>().unwrap_err();
            assert!(problem.contains(says), "{text}: {problem}");
        }
    }
}
