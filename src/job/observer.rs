//! The observer as a built-in model: [`open`].

use std::sync::Arc;

use crate::ask::{Call, Local, Random};
use crate::dataset::{DataPlace, Dataset};
use crate::error::{Error, Result};
use crate::questions::colors::Palette;
use crate::questions::observer::{Observation, ObservedFrame, VERSION, understood};
use crate::questions::rules::Rules;
use crate::types::recent::Recent;
use crate::types::{Digest, FrameId, Labels, Question};

/// Name of the model in records and tables.
pub(crate) const NAME: &str = "observer";

/// Number of cached frames and observations. A few are enough, because questions about one image follow each other.
const CACHE_SIZE: usize = 40;

/// The data set, the rules and the caches of the observer.
struct Observer {
    dataset: Arc<Dataset>,
    labels: Labels,
    rules: Rules,
    palette: Palette,
    frames: Recent<FrameId, Arc<ObservedFrame>>,
    observations: Recent<(FrameId, Digest), Arc<Observation>>,
}

impl Observer {
    fn observed_frame(&self, frame: &FrameId) -> Result<Arc<ObservedFrame>, String> {
        self.frames.get(frame, || {
            let maps = self.dataset.frame(frame).map_err(|e| e.to_string())?;
            ObservedFrame::new(&maps, &self.labels, &self.rules, &self.palette)
                .map(Arc::new)
                .map_err(|e| e.to_string())
        })
    }

    fn answer(&self, question: &Question, call: &Call<'_>) -> Result<Option<usize>, String> {
        let Some(image) = call.message.images.first() else {
            return Ok(None);
        };
        let frame = &question.frame;
        let key = (frame.clone(), image.facts().digest);
        let observation = self.observations.get(&key, || {
            let observed = self.observed_frame(frame)?;
            let pixels = image.decode().map_err(|e| e.to_string())?;
            Ok::<_, String>(Arc::new(observed.look(&pixels, &self.palette)))
        })?;
        Ok(observation.answer(question, &self.rules))
    }
}

/// Opens the observer of a data set.
///
/// # Errors
/// If the frames have no maps, or a question is not one of the rulebook's.
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
    if let Some(unknown) = questions
        .iter()
        .find(|question| !understood(question, &rules))
    {
        return Err(unusable(format!(
            "the question {:?} ({:?}) is not one of the rulebook's, and the observer understands no others",
            unknown.id.0, unknown.text
        )));
    }
    let digest = Digest::of_parts([&VERSION.to_le_bytes()[..], rules.digest().as_bytes()]);
    let observer = Observer {
        dataset: Arc::clone(dataset),
        labels,
        rules,
        palette: Palette::built_in()?,
        frames: Recent::new(CACHE_SIZE),
        observations: Recent::new(CACHE_SIZE),
    };
    if let Some(first) = questions.first() {
        observer.observed_frame(&first.frame).map_err(unusable)?;
    }
    let answer =
        Box::new(move |question: &Question, call: &Call<'_>| observer.answer(question, call));
    Ok(Local::new(NAME.to_owned(), digest, prior, answer))
}
