//! The questions of a data set that are asked: [`select`], [`QuestionBank`]; and the rules that make them: [`rules`].

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;

use rayon::prelude::*;

use crate::dataset::{
    Bank, BankArgs, BankPlace, DataPlace, Dataset, Photographs, SceneArgs, SelectionArgs, SetArgs,
    SkipBad,
};
use crate::error::{Error, Result};
use crate::files::reading;
use crate::images::progress::Progress;
use crate::images::trials::questions_by_rule::by_rule;
use crate::picture::ReadingRule;
use crate::text::words::counted;
use crate::types::{Digest, Family, FrameId, Question};
use darkqa_questions::rules::Rules;

/// The rulebook in a file; without one, the one built in.
///
/// # Errors
/// If the file cannot be read, or is not a rulebook.
pub(crate) fn rules(path: Option<&Path>) -> Result<Rules> {
    let Some(path) = path else {
        return Rules::built_in();
    };
    Rules::parse(&reading::settings(path)?).map_err(|e| e.at(path.display().to_string()))
}

/// The opened data. If they have no questions, these are made by rule.
pub(crate) fn open_data(
    data: (&DataPlace, &SceneArgs, &SetArgs),
    selection: &SelectionArgs,
    rules: &Rules,
    rule: ReadingRule,
    progress: &Progress,
) -> Result<Dataset> {
    let dataset = usable(open_unasked(data, selection, rule)?, data.2.bad, progress)?;
    if !dataset.questions().is_empty() {
        return Ok(dataset);
    }
    let questions = by_rule(&dataset, rules, progress)?;
    Ok(dataset.with_questions(questions))
}

/// The same data without images that cannot be read, and without the questions that show one, if `--skip bad` allows it. Each image is
/// decoded; with its maps if questions are to be made of them.
///
/// # Errors
/// If more is broken than `--skip bad` allows.
fn usable(dataset: Dataset, skip: Option<SkipBad>, progress: &Progress) -> Result<Dataset> {
    let Some(skip) = skip else {
        return Ok(dataset);
    };
    let with_maps = dataset.questions().is_empty() && dataset.labels().is_some();
    let shown = dataset.shown_images();
    let bar = progress.bar("decoding images", shown.len());
    let unusable: BTreeMap<FrameId, String> = shown
        .into_par_iter()
        .filter_map(|frame| {
            let read = if with_maps {
                dataset.frame(frame).map(drop)
            } else {
                dataset.decode_all(frame)
            };
            bar.inc();
            Some((frame.clone(), read.err()?.to_string()))
        })
        .collect();
    drop(bar);
    dataset.without_unusable(&unusable, skip)
}

/// The opened data, with the questions that they have themselves. No image is read.
pub(crate) fn open_unasked(
    (place, scene, set): (&DataPlace, &SceneArgs, &SetArgs),
    selection: &SelectionArgs,
    rule: ReadingRule,
) -> Result<Dataset> {
    let dataset = scene.open(place, selection.questions.as_deref(), set)?;
    Ok(dataset.with_rule(rule))
}

/// The field of a run's identity that holds the digest of the questions that are asked about every image.
pub(crate) const ASK: &str = "--ask";

/// Questions that are asked about every image, and nobody knows the answers.
#[derive(Debug)]
pub(crate) struct QuestionBank {
    place: BankPlace,
    bank: Bank,
    /// The number of questions about each image; `None` for all.
    per_image: Option<NonZeroUsize>,
}

impl QuestionBank {
    /// The questions that these flags name; `None` if they name none.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is no such question.
    pub(crate) fn open(args: &BankArgs) -> Result<Option<Self>> {
        let Some(place) = &args.ask else {
            return Ok(None);
        };
        Ok(Some(Self {
            bank: Bank::open(place)?,
            place: place.clone(),
            per_image: args.ask_per_image,
        }))
    }

    /// The digest of all questions.
    ///
    /// # Errors
    /// None in practice: the questions are text.
    pub(crate) fn digest(&self) -> Result<Digest> {
        self.bank.digest()
    }

    /// The questions in words, for the manifest: their name, and how many are asked about each image.
    pub(crate) fn words(&self) -> String {
        format!(
            "{}: {} of {} questions about each image",
            self.place,
            self.each(),
            self.bank.len()
        )
    }

    /// The number of questions about each image.
    pub(crate) fn each(&self) -> usize {
        let most = self.bank.len();
        self.per_image.map_or(most, |each| each.get().min(most))
    }

    /// The images at a place with the questions about each. What is left aside, and what is asked besides, is said.
    ///
    /// # Errors
    /// If there is no image.
    pub(crate) fn data(
        &self,
        place: &DataPlace,
        set: &SetArgs,
        rule: ReadingRule,
        progress: &Progress,
    ) -> Result<Dataset> {
        let found = Photographs::open(place, set)?;
        for note in &found.notes {
            progress.note(note);
        }
        let dataset = usable(found.dataset.with_rule(rule), set.bad, progress)?;
        let questions = self.bank.questions_about(dataset.frames(), self.per_image);
        let images = dataset.frames().count();
        progress.note(&format!(
            "--ask {}: {} about {} without answers ({} each); each model is compared with its own answers at L0, and is asked without images, too",
            self.place,
            counted(questions.len(), "question"),
            counted(images, "image"),
            self.each()
        ));
        if images == 1 {
            tracing::warn!(
                "--ask {}: with one image, nothing shows that an answer depends on the image; name a folder with several",
                self.place
            );
        }
        Ok(dataset.with_questions(questions))
    }
}

/// The questions that are asked: the first `--limit` ones of the chosen families.
pub(crate) fn select(
    mut questions: Vec<Question>,
    selection: &SelectionArgs,
) -> Result<Vec<Question>> {
    let wanted = &selection.families;
    let present: BTreeSet<&Family> = questions.iter().map(|question| &question.family).collect();
    if let Some(missing) = wanted.iter().find(|family| !present.contains(family)) {
        let present: Vec<&str> = present.into_iter().map(Family::name).collect();
        let problem = format!(
            "no question of the family {missing}; there are: {}",
            present.join(", ")
        );
        return Err(Error::usage("--families", problem));
    }
    questions.retain(|question| wanted.is_empty() || wanted.contains(&question.family));
    questions.truncate(selection.limit.map_or(usize::MAX, usize::from));
    Ok(questions)
}
