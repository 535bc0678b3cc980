//! The observer and its controls as built-in models: [`Observer`].
//!
//! A built-in model that sees images, `--model room-net`: [`RoomNet`].
//!
//! A small network, trained on well-lit drawn rooms, predicts the class and the distance of each pixel and the type of
//! the room. The answers are derived from these by rules. The only input is the image of the request. The model is a
//! demonstration, and not a vision-language model.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use darkqa_ask::{Call, Local, LocalAnswer, Random};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::replies::OBSERVER;
use darkqa_base::types::values::Recent;
use darkqa_base::types::{AnswerSource, Control, Digest, FrameId, Labels, Observed, Question, Rgb};
use darkqa_data::{DataSource, Dataset};
use darkqa_enhance::{Network, ROOM_NET, RuntimeSearch};
use darkqa_questions::colors::Palette;
use darkqa_questions::observer::controls::control_image;
use darkqa_questions::observer::tiles::area_mean;
use darkqa_questions::observer::{Observation, ObservedFrame, VERSION, is_in_rulebook};
use darkqa_questions::predicted::{PredictedFrame, PredictedMaps};
use darkqa_questions::rules::Rules;

/// Number of cached observations. A few are enough, because questions about one image follow each other; with all
/// controls, each image has one observation for each of them.
const OBSERVATIONS: usize = 64;

/// The data set, the rules and the caches that the observer and its controls share.
pub struct Observer {
    dataset: Arc<Dataset>,
    labels: Labels,
    rules: Rules,
    palette: Palette,
    frames: Recent<FrameId, Arc<ObservedFrame>>,
    observations: Recent<(FrameId, Digest, Option<Control>), Arc<Observation>>,
}

/// Name of the observer, or of one of its controls, in records and tables.
pub fn name(control: Option<Control>) -> String {
    control.map_or_else(|| OBSERVER.to_owned(), Control::model_name)
}

impl Observer {
    /// Opens the observer of a data set. It answers by the rules from which the questions were made.
    ///
    /// # Errors
    /// If the frames have no maps, or a question does not follow from the rules.
    pub fn open(
        dataset: &Arc<Dataset>,
        place: &DataSource,
        further: &[PathBuf],
        questions: &[Question],
        rules: Rules,
    ) -> Result<Arc<Self>> {
        let labels = place.labels(further)?.ok_or_else(|| {
            unusable(&format!(
                "{} has no maps: frames with segments or classes (frames.jsonl, classes.json) are needed",
                dataset.name()
            ))
        })?;
        if let Some(unknown) = questions.iter().find(|question| !is_in_rulebook(question, &rules)) {
            return Err(unusable(&format!(
                "the question {:?} ({:?}) is not one of the rulebook's, and the observer understands no others; if another \
                 rulebook made it, name that with --rules",
                unknown.id.0, unknown.text
            )));
        }
        // Each thread works on one frame, and a control may look at the image of another frame.
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let observer = Self {
            dataset: Arc::clone(dataset),
            labels,
            rules,
            palette: Palette::built_in()?,
            frames: Recent::new(2 * threads + 2),
            observations: Recent::new(OBSERVATIONS),
        };
        if let Some(first) = questions.first() {
            observer.observed_frame(&first.frame).map_err(|problem| unusable(&problem))?;
        }
        Ok(Arc::new(observer))
    }

    /// The observer as a model, or one of its controls. The seed of `prior` determines the guesses and the random
    /// choices of a control.
    pub fn model(self: &Arc<Self>, control: Option<Control>, prior: Random) -> Local {
        let (observer, seed) = (Arc::clone(self), prior.seed);
        let rules = self.rules.digest();
        let mut parts = vec![VERSION.to_le_bytes().to_vec(), rules.as_bytes().to_vec()];
        parts.extend(control.map(|control| control.name().as_bytes().to_vec()));
        let digest = Digest::from_parts(parts.iter().map(|part| &part[..]));
        Local::new(
            name(control),
            digest,
            prior,
            Box::new(move |question: &Question, call: &Call<'_>| observer.answer(question, call, control, seed)),
        )
    }

    fn observed_frame(&self, frame: &FrameId) -> Result<Arc<ObservedFrame>, String> {
        self.frames.get(frame, || {
            let maps = self.dataset.frame(frame).map_err(|e| e.to_string())?;
            ObservedFrame::new(&maps, &self.labels, &self.rules, &self.palette).map(Arc::new).map_err(|e| e.to_string())
        })
    }

    fn answer(
        &self,
        question: &Question,
        call: &Call<'_>,
        control: Option<Control>,
        seed: u64,
    ) -> Result<LocalAnswer, String> {
        let Some(image) = call.message.images.first() else {
            return Ok(LocalAnswer::default());
        };
        let frame = &question.frame;
        let key = (frame.clone(), image.facts().digest, control);
        let observation = self.observations.get(&key, || {
            let observed = self.observed_frame(frame)?;
            let mut pixels = image.shared_pixels().map_err(|e| e.to_string())?;
            if let Some(control) = control {
                let key = Digest::from_parts([&seed.to_le_bytes()[..], frame.0.as_bytes()]);
                pixels = Arc::new(control_image(control, &pixels, &observed, &key));
            }
            Ok::<_, String>(Arc::new(observed.observe(&pixels)))
        })?;
        let choice = observation.answer(question, &self.rules, &self.palette);
        Ok(LocalAnswer { choice, observed: Some(observed(&observation, choice)), guessed: false })
    }
}

fn unusable(problem: &str) -> Error {
    Error::usage("--model", format!("{OBSERVER}: {problem}"))
}

/// The part of an observation that the record of an answer stores.
fn observed(observation: &Observation, choice: Option<usize>) -> Observed {
    let outlines = observation.outlines();
    Observed {
        from: match choice {
            Some(_) => AnswerSource::Evidence,
            None => AnswerSource::Guess,
        },
        things: observation.thing_count(),
        seen: observation.seen_count(),
        detected: observation.detected_count(),
        explained_ppm: (1e6 * observation.explained_variance() + 0.5) as u32,
        outlines: outlines.map(|(id, confirmed, _)| (id, (100.0 * confirmed) as u8)).collect(),
    }
}

/// The name in flags, records and tables.
pub const NAME: &str = "room-net";

/// Version of the code that prepares the input and answers from the maps; part of the digest of the model.
const NET_VERSION: u32 = 1;

/// Width and height of the network's input and maps, in pixels.
const SIZE: [usize; 2] = [192, 144];

/// The room types of the network's last output, in its order.
const ROOMS: [&str; 6] = ["bedroom", "bathroom", "kitchen", "living room", "dining room", "office"];

/// Number of cached predictions. A few are enough, because questions about one image follow each other.
const PREDICTIONS: usize = 16;

/// The network and the rules by which its maps answer a question.
pub struct RoomNet {
    runtime: RuntimeSearch,
    /// Loaded when the first image is shown.
    network: Mutex<Option<Arc<Network>>>,
    rules: Rules,
    palette: Palette,
    predictions: Recent<Digest, Arc<PredictedFrame>>,
}

impl RoomNet {
    /// A model that answers by these rules. ONNX Runtime is searched for when the first image is shown.
    ///
    /// # Errors
    /// If the names of colours cannot be read.
    pub fn new(runtime: RuntimeSearch, rules: Rules) -> Result<Arc<Self>> {
        Ok(Arc::new(Self {
            runtime,
            network: Mutex::default(),
            rules,
            palette: Palette::built_in()?,
            predictions: Recent::new(PREDICTIONS),
        }))
    }

    /// The network as a model. If the image does not show the answer, the model guesses as `prior` does, and the record
    /// marks the guess.
    pub fn model(self: &Arc<Self>, prior: Random) -> Local {
        let net = Arc::clone(self);
        let digest = Digest::from_parts([&NET_VERSION.to_le_bytes()[..], ROOM_NET, self.rules.digest().as_bytes()]);
        Local::new(
            NAME.to_owned(),
            digest,
            prior,
            Box::new(move |question: &Question, call: &Call<'_>| {
                let choice = net.answer(question, call).map_err(|e| e.to_string())?;
                Ok(LocalAnswer { choice, observed: None, guessed: choice.is_none() })
            }),
        )
    }

    fn answer(&self, question: &Question, call: &Call<'_>) -> Result<Option<usize>> {
        let Some(image) = call.message.images.first() else {
            return Ok(None);
        };
        let frame = self.predictions.get(&image.facts().digest, || {
            let pixels = image.shared_pixels()?;
            Ok::<_, Error>(Arc::new(self.predict(&pixels)?))
        })?;
        Ok(frame.answer(question, &self.rules, &self.palette))
    }

    fn network(&self) -> Result<Arc<Network>> {
        let mut network = self.network.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(network) = &*network {
            return Ok(Arc::clone(network));
        }
        let opened = Network::open(NAME, ROOM_NET, &self.runtime.open()?)?;
        Ok(Arc::clone(network.insert(Arc::new(opened))))
    }

    /// Runs the network on an image, and measures its maps.
    fn predict(&self, image: &Rgb) -> Result<PredictedFrame> {
        let [width, height] = SIZE;
        let image = area_mean(image, SIZE).into_owned();
        // Planes of red, green and blue, from 0 to 1.
        let input = (0..3)
            .flat_map(|channel| image.samples().iter().skip(channel).step_by(3))
            .map(|code| f32::from(*code) / 255.0)
            .collect();
        let outputs = self.network()?.run(vec![1, 3, height, width], input)?;
        let [classes, metres, rooms] =
            outputs.try_into().map_err(|_| Error::Runtime(format!("{NAME}: three outputs expected")))?;
        let maps = PredictedMaps {
            image,
            classes: classes.into_iter().map(|class: f32| class as u16).collect(),
            distance_mm: metres.into_iter().map(|m: f32| (1000.0 * m) as u32).collect(),
            rooms: ROOMS.into_iter().zip(rooms).collect(),
        };
        PredictedFrame::new(maps, &self.rules, &self.palette)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_room_types_are_those_of_the_rules() {
        let rules = Rules::built_in().unwrap();
        assert_eq!(rules.book().room.order, ROOMS);
    }
}
