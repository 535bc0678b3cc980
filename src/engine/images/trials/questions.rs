//! The questions to ask about a data set: opened or generated ([`open_data`]), selected ([`select`]), or from a bank
//! ([`QuestionBank`]).

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;

use rayon::prelude::*;

use crate::data::{
    Bank, BankArgs, BankPlace, DataPlace, Dataset, Photographs, SceneArgs, SelectionArgs, SetArgs, SkipBad,
};
use crate::engine::images::progress::Progress;
use crate::engine::images::trials::questions_by_rule::generate_by_rule;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::pictures::DecodeRule;
use crate::types::text::counted;
use crate::types::{Digest, Family, FrameId, Question};
use darkqa_questions::rules::Rules;

/// The rulebook in a file; by default the built-in one.
///
/// # Errors
/// If the file cannot be read, or is not a rulebook.
pub(crate) fn rules(path: Option<&Path>) -> Result<Rules> {
    let Some(path) = path else {
        return Rules::built_in();
    };
    Rules::parse(&reading::settings(path)?).map_err(|e| e.at(path.display().to_string()))
}

/// Opens the data at a place. If they have no questions, generates them by rule.
pub(crate) fn open_data(
    place: &DataPlace,
    scene: &SceneArgs,
    set: &SetArgs,
    selection: &SelectionArgs,
    rules: &Rules,
    rule: DecodeRule,
    progress: &Progress,
) -> Result<Dataset> {
    let dataset = open_without_generating(place, scene, set, selection, rule)?;
    let dataset = skip_unusable(dataset, set.bad, progress)?;
    if !dataset.questions().is_empty() {
        return Ok(dataset);
    }
    let questions = generate_by_rule(&dataset, rules, progress)?;
    Ok(dataset.with_questions(questions))
}

/// Removes images that cannot be read, and the questions about them, if `--skip bad` is set. Decodes each image, and
/// also its maps if questions will be generated.
///
/// # Errors
/// If more images are broken than `--skip bad` allows.
fn skip_unusable(dataset: Dataset, skip: Option<SkipBad>, progress: &Progress) -> Result<Dataset> {
    let Some(skip) = skip else {
        return Ok(dataset);
    };
    let with_maps = dataset.questions().is_empty() && dataset.labels().is_some();
    let shown = dataset.shown_images();
    let bar = progress.bar("decoding images", shown.len());
    let unusable: BTreeMap<FrameId, String> = shown
        .into_par_iter()
        .filter_map(|frame| {
            let result = if with_maps { dataset.frame(frame).map(drop) } else { dataset.decode_all(frame) };
            bar.inc();
            Some((frame.clone(), result.err()?.to_string()))
        })
        .collect();
    drop(bar);
    dataset.without_unusable(&unusable, skip)
}

/// Opens the data at a place with their own questions. No image is read.
pub(crate) fn open_without_generating(
    place: &DataPlace,
    scene: &SceneArgs,
    set: &SetArgs,
    selection: &SelectionArgs,
    rule: DecodeRule,
) -> Result<Dataset> {
    let dataset = scene.open(place, selection.questions.as_deref(), set)?;
    Ok(dataset.with_rule(rule))
}

/// Field of a run's identity with the digest of the question bank.
pub(crate) const ASK: &str = "--ask";

/// Questions that are asked about every image and have no known answers (`--ask`).
#[derive(Debug)]
pub(crate) struct QuestionBank {
    place: BankPlace,
    bank: Bank,
    /// Number of questions to ask about each image; `None` for all.
    per_image: Option<NonZeroUsize>,
}

impl QuestionBank {
    /// Opens the questions of `--ask`; `None` without the flag.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is not a valid question.
    pub(crate) fn open(args: &BankArgs) -> Result<Option<Self>> {
        let Some(place) = &args.ask else {
            return Ok(None);
        };
        Ok(Some(Self { bank: Bank::open(place)?, place: place.clone(), per_image: args.ask_per_image }))
    }

    /// The digest of all questions.
    ///
    /// # Errors
    /// None in practice: the questions are text.
    pub(crate) fn digest(&self) -> Result<Digest> {
        self.bank.digest()
    }

    /// Description for the manifest: the name of the bank and the number of questions per image.
    pub(crate) fn description(&self) -> String {
        format!("{}: {} of {} questions about each image", self.place, self.questions_per_image(), self.bank.len())
    }

    /// Number of questions asked about each image.
    pub(crate) fn questions_per_image(&self) -> usize {
        let all = self.bank.len();
        self.per_image.map_or(all, |count| count.get().min(all))
    }

    /// Opens the images at a place, with the questions about each. Prints which files are ignored, and what is asked in
    /// addition.
    ///
    /// # Errors
    /// If the place has no image.
    pub(crate) fn open_images(
        &self,
        place: &DataPlace,
        set: &SetArgs,
        rule: DecodeRule,
        progress: &Progress,
    ) -> Result<Dataset> {
        let found = Photographs::open(place, set)?;
        for note in &found.notes {
            progress.note(note);
        }
        let dataset = skip_unusable(found.dataset.with_rule(rule), set.bad, progress)?;
        let questions = self.bank.questions_about(dataset.frames(), self.per_image);
        let images = dataset.frames().count();
        progress.note(&format!(
            "--ask {}: {} about {} without answers ({} each); each model is compared with its own answers at L0, and is asked without images, too",
            self.place,
            counted(questions.len(), "question"),
            counted(images, "image"),
            self.questions_per_image()
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

/// Selects the first `--limit` questions of the chosen families.
pub(crate) fn select(mut questions: Vec<Question>, selection: &SelectionArgs) -> Result<Vec<Question>> {
    let wanted = &selection.families;
    let present: BTreeSet<&Family> = questions.iter().map(|question| &question.family).collect();
    if let Some(missing) = wanted.iter().find(|family| !present.contains(family)) {
        let present: Vec<&str> = present.into_iter().map(Family::name).collect();
        let problem = format!("no question of the family {missing}; there are: {}", present.join(", "));
        return Err(Error::usage("--families", problem));
    }
    questions.retain(|question| wanted.is_empty() || wanted.contains(&question.family));
    questions.truncate(selection.limit.map_or(usize::MAX, usize::from));
    Ok(questions)
}
