//! Consistency checks of a rulebook: every class, room and token that it names must be defined.

use std::collections::BTreeSet;

use super::{ClassFlag, RuleBook, SCHEMA};
use darkqa_base::types::Choices;

impl RuleBook {
    /// Checks the rulebook.
    ///
    /// # Errors
    /// The first inconsistency, as a message.
    pub(super) fn check(&self) -> Result<(), String> {
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
