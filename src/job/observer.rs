//! The observer as a model: [`open`].

use std::sync::Arc;

use crate::ask::{Call, Local, Random};
use crate::dataset::{DataPlace, Dataset};
use crate::error::{Error, Result};
use crate::questions::colors::Palette;
use crate::questions::observer::{Observation, ObservedFrame, VERSION, understood};
use crate::questions::rules::Rules;
use crate::types::recent::Recent;
use crate::types::{Digest, FrameId, Labels, Question};

/// The name in records and tables.
pub(crate) const NAME: &str = "observer";

/// How many frames and observations are kept: questions about one image come together.
const KEPT: usize = 40;

/// What the observer looks with.
struct Observer {
    dataset: Arc<Dataset>,
    labels: Labels,
    rules: Rules,
    palette: Palette,
    frames: Recent<FrameId, Arc<ObservedFrame>>,
    sights: Recent<(FrameId, Digest), Arc<Observation>>,
}

impl Observer {
    fn watched(&self, frame: &FrameId) -> Result<Arc<ObservedFrame>, String> {
        self.frames.get(frame, || {
            let seen = self.dataset.frame(frame).map_err(|e| e.to_string())?;
            ObservedFrame::new(&seen, &self.labels, &self.rules, &self.palette)
                .map(Arc::new)
                .map_err(|e| e.to_string())
        })
    }

    fn opinion(&self, question: &Question, call: &Call<'_>) -> Result<Option<usize>, String> {
        let Some(image) = call.message.images.first() else {
            return Ok(None);
        };
        let frame = &question.frame;
        let place = (frame.clone(), image.facts().digest);
        let sight = self.sights.get(&place, || {
            let watched = self.watched(frame)?;
            let pixels = image.decode().map_err(|e| e.to_string())?;
            Ok::<_, String>(Arc::new(watched.look(&pixels, &self.palette)))
        })?;
        Ok(sight.answer(question, &self.rules))
    }
}

/// Opens the observer of a data set.
///
/// # Errors
/// Where the frames have no maps, or a question is none of the rulebook's.
pub(crate) fn open(
    dataset: &Arc<Dataset>,
    place: &DataPlace,
    questions: &[Question],
    prior: Random,
) -> Result<Local> {
    let unusable = |problem: String| Error::usage("--model", format!("{NAME}: {problem}"));
    let labels = Dataset::labels_at(place)?.ok_or_else(|| {
        unusable(format!(
            "{} has no maps: frames with segments or classes (frames.jsonl, classes.json) are needed",
            dataset.name()
        ))
    })?;
    let rules = Rules::built_in()?;
    if let Some(strange) = questions
        .iter()
        .find(|question| !understood(question, &rules))
    {
        return Err(unusable(format!(
            "the question {:?} ({:?}) is none of the rulebook's, which are all that it understands",
            strange.id.0, strange.text
        )));
    }
    let digest = Digest::of_parts([&VERSION.to_le_bytes()[..], rules.digest().as_bytes()]);
    let eye = Observer {
        dataset: Arc::clone(dataset),
        labels,
        rules,
        palette: Palette::built_in()?,
        frames: Recent::new(KEPT),
        sights: Recent::new(KEPT),
    };
    if let Some(first) = questions.first() {
        eye.watched(&first.frame).map_err(unusable)?;
    }
    let opinion = Box::new(move |question: &Question, call: &Call<'_>| eye.opinion(question, call));
    Ok(Local::new(NAME.to_owned(), digest, prior, opinion))
}
