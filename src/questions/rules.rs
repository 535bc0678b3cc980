//! The rulebook: every threshold, table and template by which questions are made, [`Rules`].
//!
//! It is one TOML file, built in as `rules.toml`, whose comments say what each entry means and what it rests on. The names of
//! the fields here are its own.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::types::{Choices, Digest};

use super::colors::Color;

/// The rulebook that is built in.
const BUILT_IN: &str = include_str!("rules.toml");
/// The schema of the file.
const SCHEMA: &str = "darkqa.rules/1";

/// A whole rulebook.
#[derive(Debug, Clone)]
pub struct Rules {
    book: Book,
    digest: Digest,
    measure_digest: Digest,
}

/// The file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Book {
    schema: String,
    /// The version of the rules, in words.
    pub version: String,
    /// Of every choice between candidates that are equally good.
    pub seed: u64,
    /// What is measured of a frame.
    pub measure: Measure,
    /// What makes a segment evidence.
    pub qualified: Qualified,
    /// The canonical classes.
    pub class: BTreeMap<String, Class>,
    /// What words add to classes.
    pub names: Names,
    /// Groups of which one hides the absence of another.
    pub confusable: Vec<Confusable>,
    /// When a room has a type.
    pub room: Room,
    /// What a segment says of its room, by its word; the first that fits.
    pub token: Vec<Token>,
    /// What speaks for a room.
    pub clue: Vec<Clue>,
    /// Which of two rooms wins.
    pub contest: Vec<Contest>,
    /// A room seen through a door.
    pub doorway: Doorway,
    /// What must hold before anything is said to be absent.
    pub closed_world: ClosedWorld,
    /// "What type of room is this?"
    pub room_type: RoomType,
    /// "Is this room suitable for this?"
    pub affordance: Affordance,
    /// What a room may be suitable for.
    pub activity: Vec<Activity>,
    /// "Is there a chair in the image?"
    pub presence: Presence,
    /// "What color is the chair in the image?"
    pub color: ColorRule,
    /// "Which object is closest to the camera?"
    pub closest: Closest,
    /// How the answers are evened out.
    pub balance: Balance,
}

/// What is measured of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Measure {
    pub border_px: usize,
    pub erosion_per_height: usize,
    pub most_depth_mm: u32,
    pub valid_depth_ppm: u64,
    pub valid_depth_px: u64,
    pub least_median_depth_mm: u32,
    pub most_median_depth_mm: u32,
    pub void_per_height: usize,
    pub purity_ppm: u64,
    pub bright: u8,
    pub crushed: u8,
    pub dark_luma: u8,
    pub detail_ppm: u64,
}

/// What makes a segment evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Qualified {
    pub area_ppm: u64,
    pub side_per_height_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
}

/// What a class is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// Part of the building.
    Structural,
    /// On a surface: never the closest object.
    Flat,
    /// Never asked, may hide anything.
    Generic,
    /// Questions name it.
    Asked,
    /// Its colour is asked.
    Color,
}

/// One canonical class.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Class {
    /// What it is called in a question; the class itself where it is not said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its article; "a" where it is not said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub article: Option<String>,
    /// What it is like.
    pub flags: BTreeSet<Flag>,
}

/// What words add to classes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Names {
    /// Flat whatever their class.
    pub flat: BTreeSet<String>,
    /// Words that a class does not cover in plain speech.
    pub unlike: BTreeMap<String, BTreeSet<String>>,
}

/// A group of which one hides the absence of another.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confusable {
    /// Its classes.
    pub classes: BTreeSet<String>,
    /// Words of segments that belong to it, too.
    #[serde(default)]
    pub names: BTreeSet<String>,
}

/// When a room has a type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Room {
    pub least_score: u32,
    pub least_lead: u32,
    pub order: Vec<String>,
}

/// What a segment says of its room, by its word.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Token {
    /// The token.
    pub token: String,
    /// The words it stands for.
    #[serde(default)]
    pub names: BTreeSet<String>,
    /// The beginnings of words it stands for.
    #[serde(default)]
    pub starts: Vec<String>,
    /// The class that the segment must have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
}

/// What speaks for a room.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clue {
    /// The room.
    pub room: String,
    /// How strongly.
    pub weight: u32,
    /// What must be seen.
    pub seen: Vec<Sign>,
    /// What may not be anywhere.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A token that must be seen so often.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sign {
    /// The token.
    pub token: String,
    /// The least area of a segment that counts.
    #[serde(default)]
    pub area_ppm: u64,
    /// How many of them at least.
    #[serde(default = "one")]
    pub least: usize,
    /// How many of them at most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<usize>,
}

fn one() -> usize {
    1
}

/// Which of two rooms wins.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contest {
    /// The room that wins.
    pub winner: String,
    /// The one it wins against.
    pub loser: String,
    /// The score that the winner needs.
    #[serde(default)]
    pub least_score: u32,
    /// The tokens whose areas are compared, the winner's first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<[String; 2]>,
    /// How many times as large the winner's must be.
    #[serde(default)]
    pub area_ratio: u64,
    /// What may not be anywhere.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A room seen through a door.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Doorway {
    pub area_ratio: u64,
    pub depth_ratio_ppm: u64,
}

/// What must hold before anything is said to be absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct ClosedWorld {
    pub void_ppm: u64,
    pub mirror_ppm: u64,
}

/// The thresholds of "What type of room is this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct RoomType {
    pub text: String,
    pub labelled_ppm: u64,
    pub least_asked: usize,
    pub large_ppm: u64,
}

/// The template of "Is this room suitable for this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Affordance {
    pub text: String,
    pub strict: bool,
}

/// What a room may be suitable for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Activity {
    /// In words that follow "I want to".
    pub activity: String,
    /// The rooms where it is done.
    pub rooms: BTreeSet<String>,
    /// Sets of tokens, any one of which makes it possible.
    pub enablers: Vec<Vec<String>>,
    /// What would do at a pinch.
    pub pinch: Vec<String>,
}

/// The thresholds of "Is there a chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Presence {
    pub text: String,
    pub area_ppm: u64,
    pub purity_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
    pub frequent: usize,
}

/// The thresholds of "What color is the chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct ColorRule {
    pub text: String,
    pub lone_ppm: u64,
    pub area_ppm: u64,
    pub eroded_px: u64,
    pub bright_ppm: u64,
    pub crushed_ppm: u64,
    pub dominant_ppm: u64,
    pub lead: u64,
    pub none_ppm: u64,
    pub candidates: ColorChoices,
    pub fixed8: Vec<Color>,
    pub neighbours: Vec<[Color; 2]>,
}

/// Which colours are offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorChoices {
    /// All eleven names.
    All11,
    /// The eight of `fixed8`.
    Fixed8,
    /// The answer and four that are no neighbours of it.
    K5,
}

/// The thresholds of "Which object is closest to the camera?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Closest {
    pub text: String,
    pub area_ppm: u64,
    pub gap_mm: u32,
    pub gap_ppm: u64,
    pub near_gap_mm: u32,
    pub gap_scope: GapScope,
    pub rival_ppm: u64,
    pub unmeasured_ppm: u64,
    pub lower_void_ppm: u64,
    pub choices: usize,
}

/// Between which objects the gap is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GapScope {
    /// The two nearest.
    Instances,
    /// The nearest, and the nearest of another class.
    Classes,
}

/// How the answers are evened out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "rules.toml says what each entry is")]
pub struct Balance {
    pub max_repeat: usize,
    pub least_entropy_ppm: u64,
    pub least_scenes: usize,
    pub room_type_share_ppm: u64,
    pub color_share_ppm: u64,
}

impl Rules {
    /// The rulebook that is built in.
    ///
    /// # Errors
    /// None: a test reads the very same text.
    pub fn built_in() -> Result<Self> {
        Self::parse(BUILT_IN)
    }

    /// Reads a rulebook.
    ///
    /// # Errors
    /// [`Error::Data`] where it is no TOML of this schema, or names a class, room or token that it has not.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |problem: String| Error::data("rules", problem);
        let book: Book = toml::from_str(text).map_err(|e| {
            let before = e.span().and_then(|span| text.get(..span.start));
            let line = before.unwrap_or_default().matches('\n').count() + 1;
            wrong(format!("line {line}: {}", e.message().replace('\n', ", ")))
        })?;
        book.check().map_err(wrong)?;
        // The content, not its spelling: a comment changes no question.
        let content = |part: String| Digest::of_parts([part.as_bytes()]);
        let whole = serde_json::to_string(&book).map_err(|e| wrong(e.to_string()))?;
        let measure = serde_json::to_string(&book.measure).map_err(|e| wrong(e.to_string()))?;
        Ok(Self {
            book,
            digest: content(whole),
            measure_digest: content(measure),
        })
    }

    /// What the rulebook says.
    #[must_use]
    pub fn book(&self) -> &Book {
        &self.book
    }

    /// The content of the whole rulebook.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// The content of what decides the statistics of a frame.
    #[must_use]
    pub fn measure_digest(&self) -> Digest {
        self.measure_digest
    }
}

impl Book {
    /// Whether a class is of this kind.
    #[must_use]
    pub fn is(&self, class: &str, flag: Flag) -> bool {
        let class = self.class.get(class);
        class.is_some_and(|class| class.flags.contains(&flag))
    }

    /// What a class is called in a question.
    #[must_use]
    pub fn name<'a>(&'a self, class: &'a str) -> &'a str {
        let name = self
            .class
            .get(class)
            .and_then(|class| class.name.as_deref());
        name.unwrap_or(class)
    }

    /// The article of a class.
    #[must_use]
    pub fn article(&self, class: &str) -> &str {
        let class = self.class.get(class);
        class
            .and_then(|class| class.article.as_deref())
            .unwrap_or("a")
    }

    /// The token of a segment by its word and class.
    #[must_use]
    pub fn token<'a>(&'a self, name: &str, class: &'a str) -> &'a str {
        let fits = |token: &&Token| {
            let named = token.names.contains(name)
                || token
                    .starts
                    .iter()
                    .any(|start| name.starts_with(start.as_str()))
                || token.names.is_empty() && token.starts.is_empty();
            named && token.class.as_deref().is_none_or(|only| only == class)
        };
        let token = self.token.iter().find(fits);
        token.map_or(class, |token| &token.token)
    }

    fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("schema {:?}; {SCHEMA:?} expected", self.schema));
        }
        if self.measure.erosion_per_height == 0 || self.measure.void_per_height == 0 {
            return Err("erosion_per_height and void_per_height must be above 0".to_owned());
        }
        self.check_classes()?;
        self.check_rooms()?;
        if !(2..=Choices::MOST).contains(&self.closest.choices) {
            return Err(format!(
                "closest.choices is {}; 2 to 26 expected",
                self.closest.choices
            ));
        }
        for (family, text, blank) in [
            ("affordance", &self.affordance.text, "{activity}"),
            ("presence", &self.presence.text, "{object}"),
            ("color", &self.color.text, "{object}"),
        ] {
            if !text.contains(blank) {
                return Err(format!("{family}.text has no {blank} in it"));
            }
        }
        Ok(())
    }

    fn check_classes(&self) -> Result<(), String> {
        let unknown = |place: &str, class: &str| {
            Err(format!(
                "{place} names the class {class:?}, which [class] has not"
            ))
        };
        for group in &self.confusable {
            for class in &group.classes {
                if !self.class.contains_key(class) {
                    return unknown("confusable", class);
                }
            }
        }
        for class in self.names.unlike.keys() {
            if !self.class.contains_key(class) {
                return unknown("names.unlike", class);
            }
        }
        for token in &self.token {
            if let Some(class) = &token.class
                && !self.class.contains_key(class)
            {
                return unknown("token", class);
            }
            if token.class.is_none() && token.names.is_empty() && token.starts.is_empty() {
                return Err(format!("the token {:?} stands for everything", token.token));
            }
        }
        Ok(())
    }

    fn check_rooms(&self) -> Result<(), String> {
        let order = &self.room.order;
        let rooms: BTreeSet<&str> = self.clue.iter().map(|clue| clue.room.as_str()).collect();
        if !(2..=Choices::MOST).contains(&order.len()) {
            return Err("room.order: 2 to 26 rooms expected".to_owned());
        }
        for (i, room) in order.iter().enumerate() {
            if order[..i].contains(room) {
                return Err(format!("room.order has {room:?} twice"));
            }
        }
        let named = order
            .iter()
            .chain(self.contest.iter().flat_map(|c| [&c.winner, &c.loser]));
        let named = named.chain(self.activity.iter().flat_map(|activity| &activity.rooms));
        for room in named {
            if !rooms.contains(room.as_str()) {
                return Err(format!("the room {room:?} has no clue"));
            }
        }
        let signs = self.clue.iter().flat_map(|clue| {
            let seen = clue.seen.iter().map(|sign| &sign.token);
            seen.chain(&clue.unseen)
        });
        let enablers = self
            .activity
            .iter()
            .flat_map(|activity| activity.enablers.iter().flatten().chain(&activity.pinch));
        let contests = self
            .contest
            .iter()
            .flat_map(|contest| contest.tokens.iter().flatten().chain(&contest.unseen));
        for token in signs.chain(enablers).chain(contests) {
            let known = self.class.contains_key(token)
                || self.token.iter().any(|known| known.token == *token);
            if !known {
                return Err(format!("{token:?} is neither a token nor a class"));
            }
        }
        let twice = self.activity.iter().enumerate().find(|(i, activity)| {
            self.activity[..*i]
                .iter()
                .any(|other| other.activity == activity.activity)
        });
        if let Some((_, twice)) = twice {
            return Err(format!(
                "the activity {:?} stands there twice",
                twice.activity
            ));
        }
        match self
            .activity
            .iter()
            .find(|activity| activity.enablers.is_empty())
        {
            Some(idle) => Err(format!("the activity {:?} has no enablers", idle.activity)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_rules_are_whole() {
        let rules = Rules::built_in().unwrap();
        let book = rules.book();
        let asked = book
            .class
            .values()
            .filter(|class| class.flags.contains(&Flag::Asked));
        assert_eq!((asked.count(), book.class.len()), (23, 40));
        assert_eq!(
            (book.room.order.len(), book.color.neighbours.len()),
            (6, 11)
        );
        assert_eq!(book.token("desk", "table"), "desk");
        assert_eq!(book.token("side table", "table"), "table");
        assert_eq!(book.token("shower curtain", "curtain"), "bath fitting");
        assert_eq!(book.token("bathtub", "bathtub"), "bathtub");
        assert_eq!(book.token("dog bed", "bed"), "pet bed");
    }

    #[test]
    fn comments_change_no_digest() {
        let commented = format!("# nothing\n{BUILT_IN}");
        let (rules, same) = (
            Rules::built_in().unwrap(),
            Rules::parse(&commented).unwrap(),
        );
        assert_eq!(rules.digest(), same.digest());
        let other = Rules::parse(&BUILT_IN.replace("gap_mm = 300", "gap_mm = 301")).unwrap();
        assert_ne!(rules.digest(), other.digest());
        assert_eq!(rules.measure_digest(), other.measure_digest());
        let other = Rules::parse(&BUILT_IN.replace("bright = 252", "bright = 251")).unwrap();
        assert_ne!(rules.measure_digest(), other.measure_digest());
    }

    #[test]
    fn broken_rules_say_what_is_wrong() {
        for (from, to, says) in [
            ("gap_mm = 300", "gap_mm = \"wide\"", "line "),
            ("gap_mm = 300", "gap_mn = 300", "unknown field `gap_mn`"),
            (
                "darkqa.rules/1",
                "darkqa.rules/9",
                "schema \"darkqa.rules/9\"",
            ),
            (
                "classes = [\"plant\"]",
                "classes = [\"palm\"]",
                "the class \"palm\"",
            ),
            (
                "token = \"nightstand\" }",
                "token = \"nightstnd\" }",
                "\"nightstnd\" is neither",
            ),
            (
                "rooms = [\"office\"]",
                "rooms = [\"study\"]",
                "\"study\" has no clue",
            ),
            (
                "{activity}, is",
                "that, is",
                "affordance.text has no {activity}",
            ),
            ("choices = 4", "choices = 1", "closest.choices is 1"),
            ("\"office\"]   #", "\"bedroom\"]   #", "\"bedroom\" twice"),
        ] {
            assert!(BUILT_IN.contains(from), "{from}");
            let error = Rules::parse(&BUILT_IN.replacen(from, to, 1))
                .unwrap_err()
                .to_string();
            assert!(
                error.starts_with("rules: ") && error.contains(says),
                "{error}"
            );
        }
    }
}
