//! Use of the enhancers of runs, in words: [`rows`] and [`enhancer_alerts`].
//!
//! Effect of parsing stored replies again by the rules of this version: [`LenientChange`].

use std::collections::BTreeSet;

use serde_json::Value;

use super::join::JoinedRun;
use crate::tables::EnhancerRow;
use crate::text::alert::{Alert, AlertKind};
use darkqa_base::error::Result;
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{
    ELSEWHERE, EnhancerNote, FIRST_REPLY_READING, JudgedImages, ProbeOutcome, RunManifest, TRAINED_ON,
};
use darkqa_base::types::text::counted;
use darkqa_base::types::{ChoiceDetail, Record};
use darkqa_runs::LLIE_BUDGET;
use darkqa_score::answers::record::reread;
use darkqa_score::choice::LENIENT_VERSION;

/// One row for each enhancer and way of using it. Runs that used it in the same way share a row.
pub(super) fn rows(runs: &[JoinedRun]) -> Vec<EnhancerRow> {
    let mut rows: Vec<(EnhancerRow, BTreeSet<&str>)> = Vec::new();
    for (run, name, note) in notes(runs) {
        let row = EnhancerRow {
            name: name.to_owned(),
            enhancer: name.to_owned(),
            how: how(note),
            looks: looks(note),
            latency: note.latency.clone(),
        };
        // The times differ between equal uses.
        let is_same =
            |known: &EnhancerRow| [&known.name, &known.how, &known.looks] == [&row.name, &row.how, &row.looks];
        match rows.iter_mut().find(|(known, _)| is_same(known)) {
            Some((known, runs)) => {
                runs.insert(&run.name);
                known.latency.extend(row.latency);
            }
            None => rows.push((row, BTreeSet::from([&*run.name]))),
        }
    }
    // The result must not depend on the order of the runs.
    rows.sort_by(|(one, in_one), (other, in_other)| (&one.name, in_one).cmp(&(&other.name, in_other)));
    let names: Vec<String> = rows.iter().map(|(row, _)| row.name.clone()).collect();
    rows.into_iter()
        .map(|(mut row, runs)| {
            if names.iter().filter(|name| **name == row.name).count() > 1 {
                let runs: Vec<&str> = runs.into_iter().collect();
                row.name = format!("{} in {}", row.name, runs.join(", "));
            }
            row
        })
        .collect()
}

/// Alerts about the enhancers.
pub(super) fn enhancer_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts: Vec<Alert> = Vec::new();
    for (run, name, note) in notes(runs) {
        let mut add = |text: String| {
            let alert = Alert::new(AlertKind::Enhancer, text);
            if !alerts.contains(&alert) {
                alerts.push(alert);
            }
        };
        let probe = note.probe.as_ref();
        match probe.map(|probe| (probe.outcome, probe.problem.as_deref())) {
            Some((ProbeOutcome::Overruled, Some(problem))) => add(format!(
                "{name} was used because of --allow bad-enhancer although its images may be read in a wrong way: {problem}."
            )),
            Some((ProbeOutcome::Doubtful, Some(problem))) => {
                add(format!("{name}, used as its sidecar or preset states: {problem}."));
            }
            _ => {}
        }
        for text in over_budget(run, note) {
            add(format!("{name}{text}."));
        }
        for remark in &note.remarks {
            add(format!("{name}: {remark}."));
        }
        if let Some(ranges) = assumed_ranges(note) {
            add(format!(
                "{name}: {ranges} assumed. Neither sidecar nor preset states its value ranges, and its images of dark frames are plausible with {ranges}."
            ));
        }
        if note.resized {
            add(format!(
                "Images were resized for {name}, so its results are not those of the model at their own size."
            ));
        }
        if let Some(images) = burnt_out(note) {
            add(format!("{name}: {images}."));
        }
        let JudgedImages { images, .. } = note.judged;
        if note.judged.flaws() > 0 && probe.is_none_or(|probe| probe.problem.is_none()) {
            add(format!(
                "{} of {images} images that {name} made of dark frames have a flaw: {}.",
                note.judged.flaws(),
                flaws(&note.judged)
            ));
        }
    }
    let has_budget = runs.iter().any(|run| run.manifest.settings.contains_key(LLIE_BUDGET));
    if has_budget && notes(runs).next().is_none() {
        alerts.push(Alert::new(
            AlertKind::Enhancer,
            format!("{} has no effect: no enhancer ran.", setting_spelling(LLIE_BUDGET)),
        ));
    }
    alerts
}

/// Sizes at which an enhancer takes longer than `--llie-budget` for more than 5 % of the images, as texts that follow
/// its name.
fn over_budget(run: &JoinedRun, note: &EnhancerNote) -> Vec<String> {
    let Some(budget) = run.manifest.settings.get(LLIE_BUDGET).and_then(Value::as_f64) else {
        return Vec::new();
    };
    if note.latency.is_empty() {
        let reason = match convention(note, ELSEWHERE, "") {
            Some(_) => "its images were made by another program",
            None => {
                "its images came from the store or an earlier version, without their times; `darkqa-eval enhance doctor MODEL IMAGES` measures it"
            }
        };
        return vec![format!(": {} cannot be checked, because {reason}", setting_spelling(LLIE_BUDGET))];
    }
    note.latency
        .iter()
        .filter(|latency| latency.within_95_ms > budget)
        .map(|latency| format!(" takes longer than {}={budget}ms: {latency}", setting_spelling(LLIE_BUDGET)))
        .collect()
}

fn notes(runs: &[JoinedRun]) -> impl Iterator<Item = (&JoinedRun, &str, &EnhancerNote)> {
    runs.iter().flat_map(|run| run.manifest.enhancers.iter().map(move |(name, note)| (run, &**name, note)))
}

/// The conventions for a network's input and output, each with its source.
fn how(note: &EnhancerNote) -> String {
    [
        convention(note, ELSEWHERE, "enhanced "),
        convention(note, "preset", "preset "),
        convention(note, TRAINED_ON, "trained on "),
        convention(note, "range_in", "fed "),
        convention(note, "color", "colours "),
        convention(note, "input = ", "input = "),
        convention(note, "channels", "channels "),
        convention(note, "range_out", "read as "),
        convention(note, "image = ", "image = "),
        convention(note, "rounding", "to bytes: "),
        unread_outputs(note),
        Some(note.sizes.clone()).filter(|sizes| !sizes.is_empty()),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>()
    .join("; ")
}

fn convention(note: &EnhancerNote, key: &str, before: &str) -> Option<String> {
    let line = note.convention.iter().find(|line| line.key == key)?;
    Some(format!("{before}{} ({})", line.value, line.source))
}

/// The assumed value ranges, joined by "and"; `None` if none is assumed.
fn assumed_ranges(note: &EnhancerNote) -> Option<String> {
    let ranges: BTreeSet<&str> = note
        .convention
        .iter()
        .filter(|line| line.key.starts_with("range_") && line.source == "assumed")
        .map(|line| &*line.value)
        .collect();
    let ranges: Vec<&str> = ranges.into_iter().collect();
    (!ranges.is_empty()).then(|| ranges.join(" and "))
}

/// The outputs of the graph that are not read; `None` if all are read.
fn unread_outputs(note: &EnhancerNote) -> Option<String> {
    let outputs: Vec<&str> =
        note.convention.iter().filter(|line| line.key == "not read").map(|line| &*line.value).collect();
    (!outputs.is_empty()).then(|| format!("not read: {}", outputs.join(", ")))
}

/// The results of checking the enhanced images of the probe and of the run.
fn looks(note: &EnhancerNote) -> String {
    let probe = match &note.probe {
        None => "no probe was run".to_owned(),
        Some(probe) => match probe.outcome {
            ProbeOutcome::Plausible => {
                format!("plausible on the {} of the probe", counted(probe.frames, "frame"))
            }
            ProbeOutcome::Doubtful => "odd in the probe".to_owned(),
            ProbeOutcome::Overruled => "refused by the probe, used all the same".to_owned(),
        },
    };
    let judged = &note.judged;
    match (judged.images, judged.flaws()) {
        (0, _) => format!("{probe}; no image of the run was checked"),
        (images, 0) => format!(
            "{probe}; no flaw in the {} of the run that {} checked",
            counted(images, "image"),
            if images == 1 { "was" } else { "were" }
        ),
        (images, flawed) => format!(
            "{probe}; a flaw in {flawed} of the {} of the run that {} checked: {}",
            counted(images, "image"),
            if images == 1 { "was" } else { "were" },
            flaws(judged)
        ),
    }
}

/// The burnt-out images of each condition; `None` without any.
fn burnt_out(note: &EnhancerNote) -> Option<String> {
    let (first, images) = note.burnt_out.first_key_value()?;
    let example = &images.example;
    let parts: Vec<String> = note
        .burnt_out
        .iter()
        .map(|(condition, found)| {
            format!(
                "{} at {condition} (on average {} % of the pixels)",
                found.images,
                found.percents / found.images.max(1)
            )
        })
        .collect();
    Some(format!(
        "images are burnt out, with codes of 254 or 255 where the dark ones have detail: {}; for example {example} at {first}",
        parts.join(", ")
    ))
}

/// The number of images with each flaw, and a few examples.
fn flaws(judged: &JudgedImages) -> String {
    let flaws: Vec<String> = judged.flawed.iter().map(|(flaw, count)| format!("{count} {}", flaw.words())).collect();
    let examples: Vec<String> =
        judged.examples.iter().map(|image| format!("{} at {}", image.frame, image.condition)).collect();
    format!("{} (for example {})", flaws.join(", "), examples.join("; "))
}

/// Difference between the stored lenient parsing of replies and the one of this version.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct LenientChange {
    /// Version of the rules by which the replies were parsed.
    from: String,
    /// Number of replies.
    replies: usize,
    /// Number of replies whose parsed choice changes.
    changed: usize,
    /// Number of replies to questions whose true choice is known.
    scored: usize,
    /// Number of replies parsed as the true choice, before and now.
    right: [usize; 2],
}

impl LenientChange {
    /// A comparison without replies, for the run of this manifest.
    pub(super) fn new(manifest: &RunManifest) -> Self {
        let from = manifest.reply_reading.as_deref();
        Self { from: from.unwrap_or(FIRST_REPLY_READING).to_owned(), ..Self::default() }
    }

    /// True if the replies were parsed by the rules of this version.
    pub(super) fn is_current(&self) -> bool {
        self.from == LENIENT_VERSION
    }

    /// Parses the replies of stored records again, and counts the changes.
    ///
    /// # Errors
    /// If a record cannot be read, or its choices are not valid.
    pub(super) fn with_records(mut self, records: impl IntoIterator<Item = Result<Record>>) -> Result<Self> {
        for record in records {
            let record = record?;
            self.add(&record.detail, &reread(record.clone())?.detail);
        }
        Ok(self)
    }

    /// Counts one reply, given its trial as parsed before and now. Ignores a trial without a reply.
    pub(super) fn add(&mut self, before: &ChoiceDetail, now: &ChoiceDetail) {
        let (Some(old), Some(new)) = (before.lenient, now.lenient) else {
            return;
        };
        self.replies += 1;
        self.changed += usize::from(old.chosen != new.chosen);
        if now.truth.is_some() {
            self.scored += 1;
            for (right, reading) in self.right.iter_mut().zip([old, new]) {
                *right += usize::from(reading.chosen == now.truth);
            }
        }
    }

    /// True if the parsed choice of any reply changes.
    pub(super) fn has_changed(&self) -> bool {
        self.changed > 0
    }

    /// The change in words: `lenient/3 reads 3 of 60 replies differently than lenient/2: the lenient accuracy is 45.0
    /// %, and was 50.0 %`.
    pub(super) fn words(&self) -> String {
        let change = format!(
            "{LENIENT_VERSION} reads {} of {} replies differently than {}",
            self.changed, self.replies, self.from
        );
        if self.scored == 0 && self.replies > 0 {
            return change;
        }
        let [before, now] = self.right.map(|right| 100.0 * right as f64 / self.scored.max(1) as f64);
        format!("{change}: the lenient accuracy is {now:.1} %, and was {before:.1} %")
    }
}
