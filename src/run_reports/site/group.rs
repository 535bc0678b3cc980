//! Which runs can be compared in one table: [`GroupKey`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use serde_json::Value;

use crate::error::Result;
use crate::report::site::{GroupDifference, GroupDigests};
use crate::run_reports::combine::Combined;
use crate::run_reports::settings::{ENCODING, readings_and_variants};
use crate::run_reports::settings::{Settings, differing, identity, pixels, short, some};
use crate::runs::mark_index::{JUDGE, PROTOCOL};
use crate::runs::stored::StoredRun;
use crate::types::manifests::RunManifest;
use crate::types::{AxisLevel, Digest, OpenDetail, RunQuestion, Variant};

/// The field of an identity with the digest of the words around the questions.
const PROMPTS: &str = "--prompts";
/// The version of enhancement reveals nothing about raw images, by which models are compared.
const ENHANCEMENT: &str = "enhancement";
/// The setting with the light of the set.
const SET_LIGHT: &str = "--light";
/// Names of what has no flag.
const QUESTIONS: &str = "questions";
const LEVELS: &str = "levels";
const VARIANT: &str = "variant";

/// Settings that the runs of one table share: questions, light and prompts.
pub(super) struct GroupKey {
    /// Its description in words.
    pub(super) title: String,
    /// The digests of its questions, light and prompts.
    pub(super) digests: GroupDigests,
    /// Settings in words, by name.
    pub(super) shared: Vec<(String, String)>,
    /// Settings that must be equal.
    settings: Settings,
    /// The images that were sent, by question and condition.
    images: HashMap<(String, String), BTreeSet<Digest>>,
    /// The choices and the true one of each question.
    truths: HashMap<String, (BTreeSet<String>, Option<String>)>,
}

impl GroupKey {
    /// Of a run of questions with choices, in the variant that its rows are about.
    ///
    /// # Errors
    /// If a setting cannot be written.
    pub(super) fn from_choices(combined: &Combined, variant: &Variant) -> Result<Self> {
        let manifest = &combined.runs[0].manifest;
        let mut levels = BTreeSet::new();
        let mut images = HashMap::<_, BTreeSet<Digest>>::new();
        let mut truths = HashMap::new();
        for item in combined.trials.items().into_iter().flatten() {
            let truth = item.truth.and_then(|truth| item.choices.get(truth));
            truths.entry(item.question.to_string()).or_insert_with(|| {
                let choices: BTreeSet<String> = item.choices.iter().cloned().collect();
                (choices, truth.cloned())
            });
        }
        for trial in combined.trials.iter() {
            let Some(condition) = trial.condition() else {
                continue;
            };
            let own = condition.kind_reading();
            if condition.enhancer.is_none() && (own.is_untouched() || own == *variant) {
                levels.insert(condition.level());
                let place = (trial.question().to_string(), condition.to_string());
                images.entry(place).or_default().extend(trial.sent());
            }
        }
        let light = variant.title();
        let key = Self {
            title: String::new(),
            digests: GroupDigests::default(),
            shared: Vec::new(),
            settings: settings(manifest, &combined.questions, &levels)?,
            images,
            truths,
        };
        key.named(
            manifest,
            combined.questions.len(),
            &[(VARIANT, &light)],
            &format!("{light}, {}", listed(&levels)),
        )
    }

    /// Of a run of open questions.
    ///
    /// # Errors
    /// If a setting cannot be written.
    pub(super) fn from_open(run: &StoredRun<OpenDetail>) -> Result<Self> {
        let mut images = HashMap::<_, BTreeSet<Digest>>::new();
        let mut levels = BTreeSet::new();
        for trial in run.trials.iter() {
            let Some(condition) = trial.condition() else {
                continue;
            };
            levels.insert(condition.level());
            if condition.enhancer.is_none() {
                let place = (trial.question().to_string(), condition.to_string());
                images.entry(place).or_default().extend(trial.sent());
            }
        }
        let setting = |name: &str| {
            let value = run.manifest.settings.get(name).and_then(Value::as_str);
            value.unwrap_or("none").to_owned()
        };
        let (judge, protocol) = (setting(JUDGE), setting(PROTOCOL));
        let key = Self {
            title: String::new(),
            digests: GroupDigests::default(),
            shared: Vec::new(),
            // Rows of other levels stand in the same table, in other columns.
            settings: settings(&run.manifest, &run.questions, &BTreeSet::new())?,
            images,
            truths: HashMap::new(),
        };
        key.named(
            &run.manifest,
            run.questions.len(),
            &[(JUDGE, &judge), (PROTOCOL, &protocol)],
            &format!("OpenEQA by LLM-Match, marked by {judge}"),
        )
    }

    /// The key with further settings, its title and what it shares in words.
    fn named(
        mut self,
        manifest: &RunManifest,
        questions: usize,
        more: &[(&str, &str)],
        what: &str,
    ) -> Result<Self> {
        let more = more
            .iter()
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        self.settings.extend(more);
        let light = light(manifest);
        let light = Digest::canonical("darkqa.site-light/1", &light)?.to_string();
        let data = identity(manifest).get("--data").cloned();
        self.title = format!(
            "{questions} questions{}, {what}",
            data.map_or_else(String::new, |data| format!(" of {}", short(&data)))
        );
        self.digests = GroupDigests {
            questions: self.settings[QUESTIONS].clone(),
            light,
            prompts: self.settings.get(PROMPTS).cloned().unwrap_or_default(),
        };
        let named = self
            .settings
            .iter()
            .filter(|(name, value)| ![QUESTIONS, PROMPTS].contains(&&***name) && !value.is_empty());
        self.shared = named
            .map(|(name, value)| (name.clone(), short(value)))
            .collect();
        Ok(self)
    }

    /// Whether two runs can stand in one table.
    fn is_same(&self, other: &Self) -> bool {
        self.settings == other.settings && self.disagreeing(other).is_none()
    }

    /// Images or true answers in which the two differ, in words; `None` without a difference.
    fn disagreeing(&self, other: &Self) -> Option<String> {
        let shared = self
            .images
            .iter()
            .filter_map(|(place, own)| Some((own, other.images.get(place)?)))
            .filter(|(own, theirs)| !own.is_empty() && !theirs.is_empty());
        let (mut all, mut differing) = (0, 0);
        for (own, theirs) in shared {
            all += 1;
            differing += usize::from(own.is_disjoint(theirs));
        }
        if differing > 0 {
            return Some(format!("{differing} of {all} images differ"));
        }
        let differing = self.truths.iter().filter(|(question, own)| {
            let theirs = other.truths.get(*question);
            theirs.is_some_and(|theirs| theirs != *own)
        });
        match differing.count() {
            0 => None,
            count => Some(format!(
                "questions with other choices or another true choice: {count}"
            )),
        }
    }

    /// Differences from the group with this number.
    pub(super) fn difference(&self, first: &Self, number: usize) -> GroupDifference {
        let names = [format!("table {number}"), "this one".to_owned()];
        let settings = [Some(first.settings.clone()), Some(self.settings.clone())];
        let lines = differing(&settings)
            .into_iter()
            .map(|setting| setting.words(&names));
        GroupDifference {
            from: number,
            lines: lines.chain(self.disagreeing(first)).collect(),
        }
    }
}

/// Runs in groups, each in the first one that it belongs to, in their order.
pub(super) fn grouped<M>(members: Vec<M>, key: impl Fn(&M) -> &GroupKey) -> Vec<Vec<M>> {
    let mut groups: Vec<Vec<M>> = Vec::new();
    for member in members {
        let own = key(&member);
        let group = groups
            .iter_mut()
            .find(|group| group.iter().all(|other| key(other).is_same(own)));
        match group {
            Some(group) => group.push(member),
            None => groups.push(vec![member]),
        }
    }
    groups
}

/// Settings that must be equal: questions, light, prompts and levels.
fn settings(
    manifest: &RunManifest,
    questions: &[RunQuestion],
    levels: &BTreeSet<AxisLevel>,
) -> Result<Settings> {
    let asked: BTreeMap<&String, (&String, BTreeSet<&String>)> = questions
        .iter()
        .map(|question| {
            let choices = question.choices.iter().collect();
            (&question.id.0, (&question.text, choices))
        })
        .collect();
    let asked = Digest::canonical("darkqa.site-questions/1", &asked)?;
    let mut settings = light(manifest);
    settings.extend(some(manifest, &[PROMPTS]));
    settings.insert(QUESTIONS.to_owned(), asked.to_string());
    settings.insert(LEVELS.to_owned(), listed(levels));
    Ok(settings)
}

/// Settings that determine raw images.
fn light(manifest: &RunManifest) -> Settings {
    let parts = [
        pixels(manifest),
        some(manifest, &ENCODING),
        readings_and_variants(manifest),
    ];
    let mut light: Settings = parts.into_iter().flatten().collect();
    light.remove(ENHANCEMENT);
    // The light in which the photographs of the set were taken: a statement about the data.
    if let Some(taken) = manifest.settings.get(SET_LIGHT).and_then(Value::as_str) {
        light.insert(SET_LIGHT.to_owned(), taken.to_owned());
    }
    light
}

fn listed(levels: &BTreeSet<AxisLevel>) -> String {
    levels
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(settings: &[(&str, &str)], image: &[u8], truth: &str) -> GroupKey {
        let settings = settings
            .iter()
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        let choices = BTreeSet::from(["red".to_owned(), "blue".to_owned()]);
        GroupKey {
            title: String::new(),
            digests: GroupDigests::default(),
            shared: Vec::new(),
            settings: settings.collect(),
            images: HashMap::from([(
                ("q".to_owned(), "L3-noise".to_owned()),
                BTreeSet::from([Digest::from_bytes(image)]),
            )]),
            truths: HashMap::from([("q".to_owned(), (choices, Some(truth.to_owned())))]),
        }
    }

    #[test]
    fn only_equal_questions_light_and_prompts_share_a_table() {
        let keys = vec![
            key(&[("--prompts", "a")], b"one", "red"),
            key(&[("--prompts", "b")], b"one", "red"),
            key(&[("--prompts", "a")], b"two", "red"),
            key(&[("--prompts", "a")], b"one", "blue"),
            key(&[("--prompts", "a")], b"one", "red"),
        ];
        let lines = |number: usize| keys[number].difference(&keys[0], 1).lines;
        assert_eq!(lines(1), ["--prompts is a in table 1 and b in this one"]);
        assert_eq!(lines(2), ["1 of 1 images differ"]);
        assert_eq!(
            lines(3),
            ["questions with other choices or another true choice: 1"]
        );
        assert!(lines(4).is_empty());
        let numbered = keys.into_iter().enumerate().collect();
        let groups: Vec<Vec<usize>> = grouped(numbered, |(_, key)| key)
            .into_iter()
            .map(|group| group.into_iter().map(|(number, _)| number).collect())
            .collect();
        assert_eq!(groups, [vec![0, 4], vec![1], vec![2], vec![3]]);
    }
}
