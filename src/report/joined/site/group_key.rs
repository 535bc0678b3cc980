//! Grouping of runs that can be compared in one table: [`GroupKey`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::error::Result;
use crate::report::joined::combine::Combined;
use crate::report::joined::settings::{
    ENCODING, Settings, differing_settings, identity_fields, identity_settings, pixel_settings,
    profile_and_variant_settings, shorten,
};
use crate::report::site::{GroupDifference, GroupDigests};
use crate::runs::mark_index::{JUDGE, PROTOCOL};
use crate::runs::stored::{StoredRun, text_setting};
use crate::types::manifests::RunManifest;
use crate::types::text::counted;
use crate::types::{AxisLevel, Digest, OpenDetail, RunQuestion, Variant};

/// Identity field with the digest of the prompts.
const PROMPTS: &str = "--prompts";
/// Identity field with the version of enhancement. Ignored, because models are compared on raw images.
const ENHANCEMENT: &str = "enhancement";
/// Setting with the light in which the photographs of the data set were taken.
const SET_LIGHT: &str = "--light";
// Names of properties that have no flag.
const QUESTIONS: &str = "questions";
const LEVELS: &str = "levels";
const VARIANT: &str = "variant";

/// Settings that the runs of one table share: questions, light and prompts.
pub(super) struct GroupKey {
    /// Title of the table.
    pub(super) title: String,
    pub(super) digests: GroupDigests,
    /// Names and values of the shared settings, as shown on the page.
    pub(super) shared: Vec<(String, String)>,
    /// Settings that must be equal.
    settings: Settings,
    /// Digests of the images sent, by question and condition.
    images: HashMap<(String, String), BTreeSet<Digest>>,
    /// The choices and the true choice, by question.
    truths: HashMap<String, (BTreeSet<String>, Option<String>)>,
}

impl GroupKey {
    /// The key of a run of questions with choices. `variant` is the one in its rows.
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
            let own = condition.variant();
            if condition.enhancer.is_none() && (own.is_untouched() || own == *variant) {
                levels.insert(condition.level());
                let place = (trial.question().to_string(), condition.to_string());
                images.entry(place).or_default().extend(trial.sent_digest());
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
        key.with_title(
            manifest,
            combined.questions.len(),
            &[(VARIANT, &light)],
            &format!("{light}, {}", level_list(&levels)),
        )
    }

    /// The key of a run of open questions.
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
                images.entry(place).or_default().extend(trial.sent_digest());
            }
        }
        let [judge, protocol] =
            [JUDGE, PROTOCOL].map(|name| text_setting(&run.manifest, name).unwrap_or("none").to_owned());
        let key = Self {
            title: String::new(),
            digests: GroupDigests::default(),
            shared: Vec::new(),
            // Without levels, because each level has its own column.
            settings: settings(&run.manifest, &run.questions, &BTreeSet::new())?,
            images,
            truths: HashMap::new(),
        };
        key.with_title(
            &run.manifest,
            run.questions.len(),
            &[(JUDGE, &judge), (PROTOCOL, &protocol)],
            &format!("OpenEQA by LLM-Match, marked by {judge}"),
        )
    }

    /// Adds further settings, then sets title, digests and shared settings. `title_end` follows the questions and the
    /// data in the title.
    fn with_title(
        mut self,
        manifest: &RunManifest,
        questions: usize,
        more: &[(&str, &str)],
        title_end: &str,
    ) -> Result<Self> {
        for (name, value) in more {
            self.settings.insert((*name).to_owned(), (*value).to_owned());
        }
        let light = light_settings(manifest);
        let light = Digest::canonical("darkqa.site-light/1", &light)?.to_string();
        let data = identity_settings(manifest).get("--data").cloned();
        self.title = format!(
            "{}{}, {title_end}",
            counted(questions, "question"),
            data.map_or_else(String::new, |data| format!(" of {}", shorten(&data)))
        );
        self.digests = GroupDigests {
            questions: self.settings[QUESTIONS].clone(),
            light,
            prompts: self.settings.get(PROMPTS).cloned().unwrap_or_default(),
        };
        self.shared = self
            .settings
            .iter()
            .filter(|(name, value)| ![QUESTIONS, PROMPTS].contains(&&***name) && !value.is_empty())
            .map(|(name, value)| (name.clone(), shorten(value)))
            .collect();
        Ok(self)
    }

    /// True if two runs can share a table.
    fn is_same(&self, other: &Self) -> bool {
        self.settings == other.settings && self.data_difference(other).is_none()
    }

    /// The difference between the images or true choices of two runs, in words; `None` if there is none.
    fn data_difference(&self, other: &Self) -> Option<String> {
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
            count => Some(format!("questions with other choices or another true choice: {count}")),
        }
    }

    /// Differences from the group `first`, which has this number.
    pub(super) fn difference(&self, first: &Self, number: usize) -> GroupDifference {
        let names = [format!("table {number}"), "this one".to_owned()];
        let settings = [Some(first.settings.clone()), Some(self.settings.clone())];
        let lines = differing_settings(&settings).into_iter().map(|setting| setting.words(&names));
        GroupDifference { from: number, lines: lines.chain(self.data_difference(first)).collect() }
    }
}

/// Groups runs, keeping their order. Each run joins the first group whose members it can be compared with.
pub(super) fn group_members<M>(members: Vec<M>, key: impl Fn(&M) -> &GroupKey) -> Vec<Vec<M>> {
    let mut groups: Vec<Vec<M>> = Vec::new();
    for member in members {
        let own = key(&member);
        let group = groups.iter_mut().find(|group| group.iter().all(|other| key(other).is_same(own)));
        match group {
            Some(group) => group.push(member),
            None => groups.push(vec![member]),
        }
    }
    groups
}

/// Settings that must be equal: questions, light, prompts and levels.
fn settings(manifest: &RunManifest, questions: &[RunQuestion], levels: &BTreeSet<AxisLevel>) -> Result<Settings> {
    let asked: BTreeMap<&String, (&String, BTreeSet<&String>)> = questions
        .iter()
        .map(|question| {
            let choices = question.choices.iter().collect();
            (&question.id.0, (&question.text, choices))
        })
        .collect();
    let asked = Digest::canonical("darkqa.site-questions/1", &asked)?;
    let mut settings = light_settings(manifest);
    settings.extend(identity_fields(manifest, &[PROMPTS]));
    settings.insert(QUESTIONS.to_owned(), asked.to_string());
    settings.insert(LEVELS.to_owned(), level_list(levels));
    Ok(settings)
}

/// Settings that determine raw images.
fn light_settings(manifest: &RunManifest) -> Settings {
    let parts =
        [pixel_settings(manifest), identity_fields(manifest, &ENCODING), profile_and_variant_settings(manifest)];
    let mut light: Settings = parts.into_iter().flatten().collect();
    light.remove(ENHANCEMENT);
    if let Some(taken) = text_setting(manifest, SET_LIGHT) {
        light.insert(SET_LIGHT.to_owned(), taken.to_owned());
    }
    light
}

fn level_list(levels: &BTreeSet<AxisLevel>) -> String {
    levels.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(settings: &[(&str, &str)], image: &[u8], truth: &str) -> GroupKey {
        let settings = settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
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
        assert_eq!(keys[1].difference(&keys[0], 1).lines, ["--prompts is a in table 1 and b in this one"]);
        assert_eq!(keys[2].difference(&keys[0], 1).lines, ["1 of 1 images differ"]);
        assert_eq!(keys[3].difference(&keys[0], 1).lines, ["questions with other choices or another true choice: 1"]);
        assert!(keys[4].difference(&keys[0], 1).lines.is_empty());
        let numbered = keys.into_iter().enumerate().collect();
        let groups: Vec<Vec<usize>> = group_members(numbered, |(_, key)| key)
            .into_iter()
            .map(|group| group.into_iter().map(|(number, _)| number).collect())
            .collect();
        assert_eq!(groups, [vec![0, 4], vec![1], vec![2], vec![3]]);
    }
}
