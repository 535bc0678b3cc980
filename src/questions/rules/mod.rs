//! Rulebook with all thresholds, tables and templates for generating questions: [`Rules`].
//!
//! A rulebook is a TOML file. The built-in one is `rules.toml`; its comments explain each entry and give its source.
//! The fields here have the same names.
//!
//! Consistency checks of a rulebook: every class, room and token that it names must be defined.

mod entries;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::TomlFault;
use darkqa_base::types::{Choices, Digest};

pub use entries::*;

/// Text of the built-in rulebook.
const BUILT_IN: &str = include_str!("../rules.toml");

/// Name and version of the schema of a rulebook file.
const SCHEMA: &str = "darkqa.rules/1";

/// A validated rulebook with its digests.
#[derive(Debug, Clone)]
pub struct Rules {
    book: RuleBook,
    digest: Digest,
    measure_digest: Digest,
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
        let book: RuleBook = toml::from_str(text).map_err(|e| {
            let TomlFault { line, problem } = TomlFault::new(text, &e);
            Error::data("rules", format!("line {line}: {problem}"))
        })?;
        book.check().map_err(|problem| Error::data("rules", problem))?;
        let digest = digest_values(&book).map_err(|e| Error::data("rules", e))?;
        let measure_digest = digest_values(&(&book.measure, &book.coarse)).map_err(|e| Error::data("rules", e))?;
        Ok(Self { book, digest, measure_digest })
    }

    /// Content of the rulebook.
    #[must_use]
    pub fn book(&self) -> &RuleBook {
        &self.book
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

impl RuleBook {
    /// Checks the rulebook.
    ///
    /// # Errors
    /// The first inconsistency, as a message.
    fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("schema {:?}; {SCHEMA:?} expected", self.schema));
        }
        let measure = &self.measure;
        if measure.erosion_per_height == 0 || measure.void_per_height == 0 {
            return Err("erosion_per_height and void_per_height must be above 0".to_owned());
        }
        let percents = [measure.light_percent, measure.around_percent];
        if measure.light_rows == 0 || percents.iter().any(|percent| !(1..=100).contains(percent)) {
            return Err("light_rows must be above 0, light_percent and around_percent 1 to 100".to_owned());
        }
        self.check_classes()?;
        self.check_words()?;
        self.check_rooms()?;
        if !(2..=Choices::MOST).contains(&self.closest.choices) {
            return Err(format!("closest.choices is {}; 2 to 26 expected", self.closest.choices));
        }
        for (family, text, blank) in [
            ("affordance.text", &self.affordance.text, "{activity}"),
            ("presence.text", &self.presence.text, "{object}"),
            ("presence.plural", &self.presence.plural, "{object}"),
            ("color.text", &self.color.text, "{object}"),
            ("color.plural", &self.color.plural, "{object}"),
        ] {
            if !text.contains(blank) {
                return Err(format!("{family} has no {blank} in it"));
            }
        }
        Ok(())
    }

    fn check_defined(&self, place: &str, class: &str) -> Result<(), String> {
        if self.class.contains_key(class) {
            return Ok(());
        }
        Err(format!("{place} names the class {class:?}, which [class] does not define"))
    }

    fn check_classes(&self) -> Result<(), String> {
        for group in &self.confusable {
            for class in &group.classes {
                self.check_defined("confusable", class)?;
            }
        }
        for class in self.names.unlike.keys() {
            self.check_defined("names.unlike", class)?;
        }
        for token in &self.token {
            if let Some(class) = &token.class {
                self.check_defined("token", class)?;
            }
            if token.class.is_none() && token.names.is_empty() && token.starts.is_empty() {
                return Err(format!(
                    "the token {:?} matches every segment; give it names, starts or a class",
                    token.token
                ));
            }
        }
        Ok(())
    }

    /// Checks that every asked class has a word, that no two classes share a word, and that `[words]` lists known words
    /// only.
    fn check_words(&self) -> Result<(), String> {
        let mut known = BTreeSet::new();
        for (class, rule) in &self.class {
            let named = [ClassFlag::Asked, ClassFlag::Color];
            if rule.words.is_empty() && named.iter().any(|flag| rule.flags.contains(flag)) {
                return Err(format!("class.{class} has no words, but questions name it"));
            }
            if let Some(twice) = rule.words.iter().find(|word| !known.insert(word.as_str())) {
                return Err(format!("class.{class} has the word {twice:?} again"));
            }
            if let Some(other) = rule.hidden.iter().find(|other| !self.class.contains_key(*other)) {
                return Err(format!("class.{class}.hidden names the class {other:?}, which [class] does not define"));
            }
        }
        let unknown = self
            .words
            .plural
            .iter()
            .chain(&self.words.an)
            .chain(self.words.spelled.values())
            .find(|word| !known.contains(word.as_str()));
        match unknown {
            Some(word) => Err(format!("[words] has {word:?}, which no class has")),
            None => Ok(()),
        }
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
        for room in order
            .iter()
            .chain(self.contest.iter().flat_map(|c| [&c.winner, &c.loser]))
            .chain(self.activity.iter().flat_map(|activity| &activity.rooms))
        {
            if !rooms.contains(room.as_str()) {
                return Err(format!("the room {room:?} has no clue"));
            }
        }
        let signs = self.clue.iter().flat_map(|clue| clue.seen.iter().map(|sign| &sign.token).chain(&clue.unseen));
        let enablers =
            self.activity.iter().flat_map(|activity| activity.enablers.iter().flatten().chain(&activity.pinch));
        let contests = self.contest.iter().flat_map(|contest| contest.tokens.iter().flatten().chain(&contest.unseen));
        for token in signs.chain(enablers).chain(contests) {
            let known = self.class.contains_key(token) || self.token.iter().any(|known| known.token == *token);
            if !known {
                return Err(format!("{token:?} is neither a token nor a class"));
            }
        }
        let repeated = self
            .activity
            .iter()
            .enumerate()
            .find(|(i, activity)| self.activity[..*i].iter().any(|other| other.activity == activity.activity));
        if let Some((_, activity)) = repeated {
            return Err(format!("the activity {:?} is defined twice", activity.activity));
        }
        match self.activity.iter().find(|activity| activity.enablers.is_empty()) {
            Some(activity) => Err(format!("the activity {:?} has no enablers", activity.activity)),
            None => Ok(()),
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
