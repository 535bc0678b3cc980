//! Rulebook with all thresholds, tables and templates for generating questions: [`Rules`].
//!
//! A rulebook is a TOML file. The built-in one is `rules.toml`; its comments explain each entry and give its source.
//! The fields here have the same names.
//!
//! Every class, room and token that a rulebook names must be defined in it. A rulebook without the table of a family,
//! such as one that was written before the family existed, has the built-in one.

mod check;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::FAMILIES;
use darkqa_base::types::text::TomlFault;
use darkqa_base::types::{Digest, Family};

use crate::colors::Color;

/// Text of the built-in rulebook.
const BUILT_IN: &str = include_str!("rules.toml");

/// Name and version of the schema of a rulebook file.
const SCHEMA: &str = "darkqa.rules/1";

/// A validated rulebook with its digests.
#[derive(Debug, Clone)]
pub struct Rules {
    book: RuleBook,
    digest: Digest,
    measure_digest: Digest,
    built_in_families: Vec<&'static str>,
}

/// Content of a rulebook file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RuleBook {
    schema: String,
    /// Version of the rules, recorded in the evidence of each question.
    pub version: String,
    /// Seed of the random choices among equally good candidates.
    pub seed: u64,
    pub measure: MeasureRule,
    pub qualified: EvidenceRule,
    /// Canonical classes by name.
    pub class: BTreeMap<String, ClassRule>,
    pub words: GrammarRule,
    pub coarse: CoarseRule,
    pub names: WordRules,
    pub confusable: Vec<Confusable>,
    pub room: RoomRule,
    /// Rules for the token of a segment, in order of priority; the first match applies.
    pub token: Vec<TokenRule>,
    pub clue: Vec<Clue>,
    pub contest: Vec<Contest>,
    pub doorway: Doorway,
    pub closed_world: ClosedWorld,
    /// "What type of room is this?"
    pub room_type: RoomTypeRule,
    /// "Is this room suitable for cooking?"
    pub affordance: AffordanceRule,
    pub activity: Vec<ActivityRule>,
    /// "Is there a chair in the image?"
    pub presence: PresenceRule,
    /// "What color is the chair in the image?"
    pub color: ColorRule,
    /// "Which object is closest to the camera?"
    pub closest: ClosestRule,
    pub balance: BalanceRule,
}

impl Rules {
    /// Returns the built-in rulebook.
    ///
    /// # Errors
    /// Never: a test parses the same text.
    pub fn built_in() -> Result<Self> {
        Self::parse(BUILT_IN)
    }

    /// Parses and checks a rulebook.
    ///
    /// # Errors
    /// [`Error::Data`] if the text is not TOML of this schema, or names a class, room or token that it does not define.
    pub fn parse(text: &str) -> Result<Self> {
        let with_line = |e| {
            let TomlFault { line, problem } = TomlFault::new(text, &e);
            Error::data("rules", format!("line {line}: {problem}"))
        };
        let (book, built_in_families): (RuleBook, _) = match toml::from_str(text) {
            Ok(book) => (book, Vec::new()),
            Err(e) => {
                let missing = missing_families(text).map_err(with_line)?;
                if missing.is_empty() {
                    return Err(with_line(e));
                }
                // Missing tables are appended, so that the line numbers in errors are those of the text.
                let whole = format!("{text}\n{}", built_in_tables(&missing)?);
                (toml::from_str(&whole).map_err(with_line)?, missing)
            }
        };
        book.check().map_err(|problem| Error::data("rules", problem))?;
        let digest = digest_values(&book).map_err(|e| Error::data("rules", e))?;
        let measure_digest = digest_values(&(&book.measure, &book.coarse)).map_err(|e| Error::data("rules", e))?;
        Ok(Self { book, digest, measure_digest, built_in_families })
    }

    /// Content of the rulebook.
    #[must_use]
    pub fn book(&self) -> &RuleBook {
        &self.book
    }

    /// Families whose table the text does not have, so that the built-in one is used.
    #[must_use]
    pub fn built_in_families(&self) -> &[&'static str] {
        &self.built_in_families
    }

    /// Digest of the whole rulebook.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// Digest of `[measure]` and `[coarse]`, which determine the statistics of a frame.
    #[must_use]
    pub fn measure_digest(&self) -> Digest {
        self.measure_digest
    }
}

/// The families whose table a rulebook does not have.
fn missing_families(text: &str) -> std::result::Result<Vec<&'static str>, toml::de::Error> {
    let given: toml::Table = toml::from_str(text)?;
    Ok(FAMILIES.iter().map(|row| row.name).filter(|name| !given.contains_key(*name)).collect())
}

/// The built-in tables of some families, as the text of a rulebook.
fn built_in_tables(families: &[&str]) -> Result<String> {
    let mut tables: toml::Table = toml::from_str(BUILT_IN).map_err(|e| Error::data("rules", e))?;
    tables.retain(|name, _| families.contains(&name));
    toml::to_string(&tables).map_err(|e| Error::data("rules", e))
}

/// Digest of the values of a rulebook or of a part; comments in the file do not change it.
fn digest_values(values: &impl Serialize) -> serde_json::Result<Digest> {
    let json = serde_json::to_string(values)?;
    Ok(Digest::from_parts([json.as_bytes()]))
}

impl RuleBook {
    /// True if a class has a flag; false for unknown classes.
    #[must_use]
    pub fn has_flag(&self, class: &str, flag: ClassFlag) -> bool {
        self.class.get(class).is_some_and(|class| class.flags.contains(&flag))
    }

    /// Spelling in questions of a data set's `word` for an object; `None` if the class does not have this word.
    #[must_use]
    pub fn question_word(&self, class: &str, word: &str) -> Option<&str> {
        let plain = word.replace('_', " ");
        let spelled = self.words.spelled.get(&plain).unwrap_or(&plain);
        let words = &self.class.get(class)?.words;
        words.iter().find(|known| *known == spelled).map(String::as_str)
    }

    /// Fills an object's word into a template: `plural` for plural words, else `singular` with the article.
    #[must_use]
    pub fn fill_template(&self, singular: &str, plural: &str, word: &str) -> String {
        if self.words.plural.contains(word) {
            return plural.replace("{object}", word);
        }
        let article = if self.words.an.contains(word) { "an" } else { "a" };
        singular.replace("{article}", article).replace("{object}", word)
    }

    /// True if a data set's word ends in a word of the class and may name such an object: "decorative lamp" ends in
    /// "lamp".
    #[must_use]
    pub fn resembles(&self, word: &str, class: &str) -> bool {
        let plain = word.replace('_', " ");
        let spelled = self.words.spelled.get(&plain).unwrap_or(&plain);
        self.class.get(class).into_iter().flat_map(|class| &class.words).any(|known| {
            spelled.strip_suffix(known.as_str()).is_some_and(|before| before.is_empty() || before.ends_with(' '))
        })
    }

    /// Token of a segment with the word `name` and this class; the class itself if no rule matches.
    #[must_use]
    pub fn token<'a>(&'a self, name: &str, class: &'a str) -> &'a str {
        let token = self.token.iter().find(|token| {
            let word_matches = token.names.contains(name)
                || token.starts.iter().any(|start| name.starts_with(start.as_str()))
                || token.names.is_empty() && token.starts.is_empty();
            word_matches && token.class.as_deref().is_none_or(|only| only == class)
        });
        token.map_or(class, |token| &token.token)
    }
}

/// Thresholds for measuring a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasureRule {
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
    pub luminous: BTreeSet<String>,
    pub light_rows: usize,
    pub light_percent: u64,
    pub around_percent: u64,
}

/// Thresholds that a segment must pass to be evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvidenceRule {
    pub area_ppm: u64,
    pub side_per_height_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
}

/// A property of a class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassFlag {
    /// Part of the building, such as a wall.
    Structural,
    /// Flat on a surface, so never the closest object.
    Flat,
    /// Contains objects of many kinds; never asked.
    Generic,
    /// Questions name the class.
    Asked,
    /// Questions ask for the colour of the class.
    Color,
}

/// One canonical class of mpcat40.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassRule {
    /// Properties of the class; may be empty.
    pub flags: BTreeSet<ClassFlag>,
    /// Words that questions use for objects of the class; may be empty for classes that no question names.
    #[serde(default)]
    pub words: Vec<String>,
    /// Classes whose unnamed pixels may hide an object of this class.
    #[serde(default)]
    pub hidden: BTreeSet<String>,
}

/// Grammar and spelling of the words in questions.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrammarRule {
    /// Words that are plural.
    pub plural: BTreeSet<String>,
    /// Words with the article "an"; the others take "a".
    pub an: BTreeSet<String>,
    /// Spelling in questions of words that data sets spell differently.
    pub spelled: BTreeMap<String, String>,
}

/// Vague words, which are used for several kinds of objects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoarseRule {
    /// Names of segments without information.
    pub vague: BTreeSet<String>,
    /// Words that identify an object, by label space. In a label space that is not listed, all words do.
    pub spaces: BTreeMap<String, BTreeSet<String>>,
}

impl CoarseRule {
    /// True if the name of a segment identifies the object.
    #[must_use]
    pub fn is_name(&self, name: &str) -> bool {
        !name.is_empty() && !name.starts_with("unknown") && !self.vague.contains(name)
    }

    /// True if the word of a label space identifies an object.
    #[must_use]
    pub fn identifies_object(&self, space: &str, word: &str) -> bool {
        let words = self.spaces.get(space);
        words.is_none_or(|words| words.contains(word)) && !word.is_empty()
    }
}

/// Words that change how a segment of a class is treated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WordRules {
    /// Words whose segments are flat, regardless of their class.
    pub flat: BTreeSet<String>,
    /// Words that do not fit their class in plain English, by class.
    pub unlike: BTreeMap<String, BTreeSet<String>>,
}

/// Classes and words that may be mistaken for each other: if one is visible, none of the others can be called absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confusable {
    pub classes: BTreeSet<String>,
    /// Words of segments that also belong to the group.
    #[serde(default)]
    pub names: BTreeSet<String>,
}

/// Scores that a room type needs, and the room types that questions ask about.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomRule {
    pub least_score: u32,
    pub least_lead: u32,
    pub order: Vec<String>,
}

/// A token: a kind of object that matters for the room type, recognized by the word and class of a segment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TokenRule {
    /// Name of the token.
    pub token: String,
    /// Words of the data set that the token covers.
    #[serde(default)]
    pub names: BTreeSet<String>,
    /// Prefixes of words that the token covers.
    #[serde(default)]
    pub starts: Vec<String>,
    /// Class that the segment must have; `None` for any class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
}

/// A combination of objects that is evidence for a room type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clue {
    /// Room type that the clue supports.
    pub room: String,
    /// Points added to the score of the room type.
    pub weight: u32,
    /// Objects that must all be visible.
    pub seen: Vec<Sign>,
    /// Tokens that must not have a pixel in the frame.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A token and the number of its segments that a clue needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sign {
    /// Token of the segments.
    pub token: String,
    /// Minimum area of a segment that counts, in millionths of the frame.
    #[serde(default)]
    pub area_ppm: u64,
    /// Minimum number of segments.
    #[serde(default = "one")]
    pub least: usize,
    /// Maximum number of segments; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<usize>,
}

fn one() -> usize {
    1
}

/// A rule that decides between two rival room types.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contest {
    /// Room type that wins.
    pub winner: String,
    /// Room type that loses.
    pub loser: String,
    /// Minimum score of the winner.
    #[serde(default)]
    pub least_score: u32,
    /// Tokens whose areas are compared, the winner's first; `None` for no comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<[String; 2]>,
    /// Minimum ratio of the winner's area to the other area.
    #[serde(default)]
    pub area_ratio: u64,
    /// Tokens that must not have a pixel in the frame.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// Minimum ratios of area and depth between a room and another one that is seen through a door.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Doorway {
    pub area_ratio: u64,
    pub depth_ratio_ppm: u64,
}

/// Limits for a frame in which a class or token can be called absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedWorld {
    pub void_ppm: u64,
    pub mirror_ppm: u64,
}

/// Thresholds of "What type of room is this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomTypeRule {
    pub text: String,
    pub labelled_ppm: u64,
    pub least_asked: usize,
    pub large_ppm: u64,
}

/// Template of "Is this room suitable for this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AffordanceRule {
    pub text: String,
    pub strict: bool,
}

/// An activity that a room may be suitable for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActivityRule {
    /// The activity, in words that follow "I want to".
    pub activity: String,
    /// Room types where the activity is done.
    pub rooms: BTreeSet<String>,
    /// Sets of tokens; one complete set makes the activity possible.
    pub enablers: Vec<Vec<String>>,
    /// Tokens that could substitute an enabler.
    pub pinch: Vec<String>,
}

/// The thresholds of "Is there a chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PresenceRule {
    pub text: String,
    pub plural: String,
    pub area_ppm: u64,
    pub purity_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
    pub frequent: usize,
}

/// The thresholds of "What color is the chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorRule {
    pub text: String,
    pub plural: String,
    pub lone_ppm: u64,
    pub area_ppm: u64,
    pub eroded_px: u64,
    pub bright_ppm: u64,
    pub crushed_ppm: u64,
    pub dominant_ppm: u64,
    pub lead: u64,
    pub none_ppm: u64,
    pub view_px: u64,
    pub candidates: ColorChoices,
    pub fixed8: Vec<Color>,
    pub neighbours: Vec<[Color; 2]>,
}

/// Colours that are offered as choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorChoices {
    /// All eleven colour names.
    All11,
    /// The colours listed in `fixed8`.
    Fixed8,
    /// The answer and four colours that are unlikely to be confused with it.
    K5,
}

/// Thresholds of "Which object is closest to the camera?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosestRule {
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

/// Objects between which the gap is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GapScope {
    /// The two nearest objects, even of the same class.
    Instances,
    /// The nearest object and the nearest one of another class.
    Classes,
}

/// Limits for balancing the answers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceRule {
    pub max_repeat: usize,
    pub least_entropy_ppm: u64,
    pub least_scenes: usize,
    pub room_type_share_ppm: u64,
    pub color_share_ppm: u64,
}

impl BalanceRule {
    /// Maximum share of one answer of a family with `--balance full`, in millionths; `None` for no limit.
    #[must_use]
    pub fn share_ppm(&self, family: &Family) -> Option<u64> {
        match family {
            Family::RoomType => Some(self.room_type_share_ppm),
            Family::Color => Some(self.color_share_ppm),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_rules_are_complete() {
        let rules = Rules::built_in().unwrap();
        let book = rules.book();
        let asked = book.class.values().filter(|class| class.flags.contains(&ClassFlag::Asked)).count();
        assert_eq!((asked, book.class.len()), (23, 40));
        assert_eq!((book.room.order.len(), book.color.neighbours.len()), (6, 11));
        assert_eq!(book.token("desk", "table"), "desk");
        assert_eq!(book.token("side table", "table"), "table");
        assert_eq!(book.token("shower curtain", "curtain"), "bath fitting");
        assert_eq!(book.token("bathtub", "bathtub"), "bathtub");
        assert_eq!(book.token("dog bed", "bed"), "pet bed");
    }

    #[test]
    fn a_rulebook_without_a_family_has_the_built_in_one() {
        let (start, end) = (BUILT_IN.find("[closest]").unwrap(), BUILT_IN.find("\n[balance]").unwrap());
        let older = format!("{}{}", &BUILT_IN[..start], &BUILT_IN[end..]);
        let (rules, built_in) = (Rules::parse(&older).unwrap(), Rules::built_in().unwrap());
        assert_eq!((rules.book(), rules.digest()), (built_in.book(), built_in.digest()));
        assert_eq!((rules.built_in_families(), built_in.built_in_families()), (&["closest"][..], &[][..]));
        // Faults are named by the line of the text.
        let fault = older.replacen("least_scenes", "least_scene", 1);
        let line = 1 + fault[..fault.find("least_scene ").unwrap()].matches('\n').count();
        let error = Rules::parse(&fault).unwrap_err().to_string();
        assert!(error.contains(&format!("line {line}: unknown field `least_scene`")), "{error}");
        // Other tables are needed.
        let end = older.find("\n[balance]").unwrap();
        let error = Rules::parse(&older[..end]).unwrap_err().to_string();
        assert!(error.contains("missing field `balance`"), "{error}");
    }

    #[test]
    fn words_have_article_or_plural() {
        let rules = Rules::built_in().unwrap();
        let book = rules.book();
        for word in book.class.values().flat_map(|class| &class.words).filter(|word| !book.words.plural.contains(*word))
        {
            let vowel = word.starts_with(['a', 'e', 'i', 'o', 'u']);
            assert_eq!(book.words.an.contains(word), vowel, "{word}");
            let plural = word.ends_with('s') && word != "chest of drawers";
            assert!(!plural, "{word} is not in words.plural");
        }
    }

    #[test]
    fn digests_ignore_comments_and_track_values() {
        let commented = format!("# nothing\n{BUILT_IN}");
        let (rules, same) = (Rules::built_in().unwrap(), Rules::parse(&commented).unwrap());
        assert_eq!(rules.digest(), same.digest());
        let other = Rules::parse(&BUILT_IN.replace("gap_mm = 300", "gap_mm = 301")).unwrap();
        assert_ne!(rules.digest(), other.digest());
        assert_eq!(rules.measure_digest(), other.measure_digest());
        let other = Rules::parse(&BUILT_IN.replace("bright = 252", "bright = 251")).unwrap();
        assert_ne!(rules.measure_digest(), other.measure_digest());
    }

    #[test]
    fn invalid_rules_are_reported() {
        for (from, to, expected) in [
            ("gap_mm = 300", "gap_mm = \"wide\"", "line "),
            ("gap_mm = 300", "gap_mn = 300", "unknown field `gap_mn`"),
            ("darkqa.rules/1", "darkqa.rules/9", "schema \"darkqa.rules/9\""),
            ("classes = [\"plant\"]", "classes = [\"palm\"]", "the class \"palm\""),
            ("token = \"nightstand\" }", "token = \"nightstnd\" }", "\"nightstnd\" is neither"),
            ("rooms = [\"office\"]", "rooms = [\"study\"]", "\"study\" has no clue"),
            ("{activity}, is", "that, is", "affordance.text has no {activity}"),
            ("choices = 4", "choices = 1", "closest.choices is 1"),
            ("words = [\"sofa\"]", "words = []", "class.sofa has no words"),
            ("words = [\"sofa\"]", "words = [\"bed\"]", "has the word \"bed\" again"),
            ("\"towels\"]\n# Words", "\"oxen\"]\n# Words", "[words] has \"oxen\""),
            ("hidden = [\"furniture\"]", "hidden = [\"attic\"]", "names the class \"attic\""),
            ("\"office\"]   #", "\"bedroom\"]   #", "\"bedroom\" twice"),
        ] {
            assert!(BUILT_IN.contains(from), "{from}");
            let error = Rules::parse(&BUILT_IN.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with("rules: ") && error.contains(expected), "{error}");
        }
    }
}
