//! A site about many runs: [`site`]. Each run has the page of its report, and rows in a table with the runs that it can
//! be compared with.
//!
//! Ranks of the models in one table of the site: [`ranked_rows`].
//!
//! A run of questions with choices on the site: [`ChoiceMember`].
//!
//! Grouping of runs that can be compared in one table: [`GroupKey`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;

use super::combine::{CombinedRuns, clusters, combine};
use super::open;
use super::settings::{
    ENCODING, FlagValues, differing_settings, identity_fields, identity_settings, pixel_settings,
    profile_and_variant_settings, shorten,
};
use super::written::{Scored, without_hidden_models};
use crate::outputs::html_page;
use crate::site::{
    GroupDifference, GroupDigests, GroupRows, LeaderboardSite, ModelRunRow, OpenRow, Ranking, RunLink, SiteGroup,
    choice_rows, open_rows,
};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::{counted, plural};
use darkqa_base::types::{AxisLevel, ChoiceDetail, Digest, ModelListing, OpenDetail, RunQuestion, Trials, Variant};
use darkqa_runs::mark_index::{JUDGE, PROTOCOL};
use darkqa_runs::stored::{AnyRun, StoredRun, text_setting};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{BestInTheDark, best_in_the_dark, rank_ranges};
use darkqa_score::grid::Grid;

/// A run of open questions, with its rows.
struct OpenMember {
    key: GroupKey,
    rows: Vec<OpenRow>,
}

/// Makes the site of runs, in their order.
///
/// # Errors
/// If a run has no records or a record is broken.
pub fn site(runs: Vec<AnyRun>) -> Result<LeaderboardSite> {
    let mut site = LeaderboardSite { groups: Vec::new(), others: Vec::new(), pages: Vec::new() };
    let (mut choices, mut open) = (Vec::new(), Vec::new());
    let mut pages = BTreeSet::new();
    for run in runs {
        match run {
            AnyRun::Choice(run) => {
                let link = link(&run.name(), &run.manifest, &mut pages);
                choices.extend(add_choices(run, link, &mut site)?);
            }
            AnyRun::Open(run) => {
                let link = link(&run.name(), &run.manifest, &mut pages);
                open.push(add_open(run, link, &mut site)?);
            }
        }
    }
    let groups = group_members(choices, |member| &member.key);
    add_groups(&mut site, groups, |member| &member.key, ranked_rows);
    let groups = group_members(open, |member| &member.key);
    add_groups(
        &mut site,
        groups,
        |member| &member.key,
        |members| {
            let rows = members.into_iter().flat_map(|member| member.rows);
            GroupRows::Open(rows.collect())
        },
    );
    Ok(site)
}

/// Adds groups of one kind, each with its differences from the first.
fn add_groups<M>(
    site: &mut LeaderboardSite,
    groups: Vec<Vec<M>>,
    key: impl Fn(&M) -> &GroupKey,
    rows: impl Fn(Vec<M>) -> GroupRows,
) {
    let first_number = site.groups.len() + 1;
    let first = groups.first().and_then(|members| members.first());
    let heads: Vec<_> = groups
        .iter()
        .filter_map(|members| {
            let own = key(members.first()?);
            let differs = first.map(|first| own.difference(key(first), first_number));
            Some((own.title.clone(), own.digests.clone(), own.shared.clone(), differs))
        })
        .collect();
    for (index, (members, (title, digests, shared, differs))) in groups.into_iter().zip(heads).enumerate() {
        site.groups.push(SiteGroup {
            title,
            digests,
            shared,
            differs: differs.filter(|_| index > 0),
            rows: rows(members),
        });
    }
}

/// Adds the page of a run. Returns `None` for a run without rows, and then adds it to the other runs with the reason.
fn add_choices(
    run: StoredRun<ChoiceDetail>,
    link: RunLink,
    site: &mut LeaderboardSite,
) -> Result<Option<ChoiceMember>> {
    let combined = combine(vec![without_hidden_models(run)?])?;
    let scored = Scored::new(&combined);
    let page = html_page(&scored.report(&combined, &[]), &combined.page_inputs())?.into_bytes();
    let Scored::Accuracy(findings) = &scored else {
        let why = "nobody knows the true answers to its questions";
        site.others.push((link.clone(), why.to_owned()));
        site.pages.push((link, page));
        return Ok(None);
    };
    let variant = findings.shown().grid.main_variant();
    let variant = variant.unwrap_or(Variant::NONE);
    let rows = choice_rows(findings.shown(), &variant, &link);
    if rows.is_empty() {
        let why = "no model was shown an image";
        site.others.push((link.clone(), why.to_owned()));
        site.pages.push((link, page));
        return Ok(None);
    }
    let key = GroupKey::from_choices(&combined, &variant)?;
    drop(scored);
    site.pages.push((link.clone(), page));
    Ok(Some(ChoiceMember {
        key,
        rows,
        trials: compared_trials(&combined, &variant),
        questions: combined.questions,
        run: link,
    }))
}

/// The trials by which models are compared: raw images at L0 and in the main variant.
fn compared_trials(combined: &CombinedRuns, variant: &Variant) -> Trials<ChoiceDetail> {
    let trials = combined.trials.iter().filter(|trial| {
        trial.condition().is_some_and(|condition| {
            let own = condition.variant();
            condition.enhancer.is_none() && (own.is_untouched() || own == *variant)
        })
    });
    let mut compared = Trials::default();
    for trial in trials {
        compared.copy(trial, 0);
    }
    compared
}

fn add_open(run: StoredRun<OpenDetail>, link: RunLink, site: &mut LeaderboardSite) -> Result<OpenMember> {
    let run = without_hidden_models(run)?;
    let key = GroupKey::from_open(&run)?;
    let scores = open::Scores::new(open::combine(vec![run])?)?;
    let rows = open_rows(scores.summary(), &link);
    site.pages.push((link, html_page(&scores.report(), &scores.run.page_inputs())?.into_bytes()));
    Ok(OpenMember { key, rows })
}

/// The link to the page of a run. The file is named after the run, with characters that are safe in URLs, and numbered
/// if the name is already in `taken`.
fn link(name: &str, manifest: &RunManifest, taken: &mut BTreeSet<String>) -> RunLink {
    let stem: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
    let stem = stem.trim_start_matches('.');
    let stem = if stem.is_empty() { "run" } else { stem };
    let mut page = format!("{stem}.html");
    let mut number = 2;
    while !taken.insert(page.to_lowercase()) {
        page = format!("{stem}-{number}.html");
        number += 1;
    }
    let day = manifest.updated.split('T').next().unwrap_or_default();
    RunLink { name: name.to_owned(), page, date: day.to_owned(), version: manifest.version.clone() }
}

/// The rows of runs that can be compared, in the order of their ranks. As in the report, models are ranked by mean
/// accuracy in the dark on the items that all of them answered at all levels. References get no rank.
fn ranked_rows(members: Vec<ChoiceMember>) -> GroupRows {
    let names = distinct_names(&members);
    let (mut trials, mut questions, mut rows) = (Trials::default(), Vec::new(), Vec::new());
    for member in members {
        let name = |model: &str| names[&(member.run.page.clone(), model.to_owned())].clone();
        let is_named = |model: &str| names.contains_key(&(member.run.page.clone(), model.to_owned()));
        let mut own = member.trials;
        own.retain(|trial| is_named(trial.model()));
        own.rename(|model| is_named(model).then(|| name(model)));
        for trial in own.iter() {
            trials.copy(trial, 0);
        }
        rows.extend(member.rows.into_iter().map(|row| (name(&row.model), row)));
        questions.extend(member.questions);
    }
    let models = rows.iter().filter(|(_, row)| !row.is_reference()).count();
    let (best, unit) = best(&trials, &questions);
    // A single model needs no comparison with references.
    let best = best.filter(|_| models > 1);
    let ranks: BTreeMap<String, _> = best
        .iter()
        .flat_map(|best| best.models.iter().zip(rank_ranges(best)))
        .map(|(model, rank)| (model.model.clone(), rank))
        .collect();
    let mut rows: Vec<ModelRunRow> = rows
        .into_iter()
        .map(|(name, mut row)| {
            row.rank = ranks.get(&name).copied();
            row
        })
        .collect();
    rows.sort_by_key(ModelRunRow::sort_key);
    let words = words(best.as_ref(), models, &unit);
    GroupRows::Choices(rows, Ranking { words })
}

/// A distinct name of each model of each run, by page and model: followed by the page if another run has a model of
/// this name.
fn distinct_names(members: &[ChoiceMember]) -> BTreeMap<(String, String), String> {
    let mut times = BTreeMap::<&str, usize>::new();
    for row in members.iter().flat_map(|member| &member.rows) {
        *times.entry(&row.model).or_default() += 1;
    }
    members
        .iter()
        .flat_map(|member| &member.rows)
        .map(|row| {
            let name = match times[&*row.model] {
                1 => row.model.clone(),
                _ => format!("{} ({})", row.model, row.run.page),
            };
            ((row.run.page.clone(), row.model.clone()), name)
        })
        .collect()
}

/// The comparison of all models, and the unit treated as independent.
fn best(trials: &Trials<ChoiceDetail>, questions: &[RunQuestion]) -> (Option<BestInTheDark>, String) {
    let clusters = clusters(trials, questions);
    let grid = Grid::for_models(trials, &clusters, &ModelListing::default(), |_| true);
    (best_in_the_dark(&grid, ParsingMode::Strict), clusters.unit().to_string())
}

/// The paragraph about the basis of the ranks, or the reason why there are none.
fn words(best: Option<&BestInTheDark>, models: usize, unit: &str) -> String {
    let Some(best) = best else {
        return match models {
            0 => "No model is ranked: random and the observer stand for comparison.".to_owned(),
            1 => "One model: there is no other to rank it with.".to_owned(),
            _ => "The models are not ranked: no two of them answered the same questions at L0 and at a darker level."
                .to_owned(),
        };
    };
    let levels = best.levels.iter().map(ToString::to_string);
    let mut words = format!(
        "Ranks are by mean accuracy over the dark levels ({}), on the {} items that {} models answered at all levels \
         from L0 ({} {unit}s), corrected by Holm over {}.",
        levels.collect::<Vec<_>>().join(", "),
        best.items,
        match best.models.len() {
            2 => "both".to_owned(),
            models => format!("all {models}"),
        },
        best.clusters,
        match best.pairs.len() {
            1 => "1 pair".to_owned(),
            pairs => format!("all {pairs} pairs"),
        },
    );
    if best.dropped > 0 {
        let _ = write!(words, " {} more items are left out, because a model has no reply to them.", best.dropped);
    }
    if !best.without.is_empty() {
        let models = plural(best.without.len(), "model is", "models are");
        let _ = write!(words, " {models} not ranked: fewer answers at these levels.");
    }
    if !best.is_possible() {
        let _ = write!(words, " With so few {unit}s no model can be shown to be better than another.");
    }
    words
}

/// A run of questions with choices: its rows, and the trials by which models are compared.
pub(super) struct ChoiceMember {
    key: GroupKey,
    run: RunLink,
    rows: Vec<ModelRunRow>,
    trials: Trials<ChoiceDetail>,
    questions: Vec<RunQuestion>,
}

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
    title: String,
    digests: GroupDigests,
    /// Names and values of the shared settings, as shown on the page.
    shared: Vec<(String, String)>,
    /// Settings that must be equal.
    settings: FlagValues,
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
    fn from_choices(combined: &CombinedRuns, variant: &Variant) -> Result<Self> {
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
    fn from_open(run: &StoredRun<OpenDetail>) -> Result<Self> {
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
    fn difference(&self, first: &Self, number: usize) -> GroupDifference {
        let names = [format!("table {number}"), "this one".to_owned()];
        let settings = [Some(first.settings.clone()), Some(self.settings.clone())];
        let lines = differing_settings(&settings).into_iter().map(|setting| setting.words(&names));
        GroupDifference { from: number, lines: lines.chain(self.data_difference(first)).collect() }
    }
}

/// Groups runs, keeping their order. Each run joins the first group whose members it can be compared with.
fn group_members<M>(members: Vec<M>, key: impl Fn(&M) -> &GroupKey) -> Vec<Vec<M>> {
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
fn settings(manifest: &RunManifest, questions: &[RunQuestion], levels: &BTreeSet<AxisLevel>) -> Result<FlagValues> {
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
fn light_settings(manifest: &RunManifest) -> FlagValues {
    let parts =
        [pixel_settings(manifest), identity_fields(manifest, &ENCODING), profile_and_variant_settings(manifest)];
    let mut light: FlagValues = parts.into_iter().flatten().collect();
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
