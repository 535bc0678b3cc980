//! A built-in model that sees images, `--model room-net`: [`RoomNet`].
//!
//! A small network, trained on well-lit drawn rooms, predicts the class and the distance of each pixel and the type of
//! the room. The answers are derived from these by rules. The only input is the image of the request. The model is a
//! demonstration, and not a vision-language model.

use std::sync::{Arc, Mutex, PoisonError};

use crate::ask::{Call, Local, LocalAnswer, Random};
use crate::error::{Error, Result};
use crate::types::values::Recent;
use crate::types::{Digest, Question, Rgb};
use darkqa_enhance::{Network, ROOM_NET, RuntimeSearch};
use darkqa_questions::colors::Palette;
use darkqa_questions::observer::resample::area_mean;
use darkqa_questions::predicted::{PredictedFrame, PredictedMaps};
use darkqa_questions::rules::Rules;

/// The name in flags, records and tables.
pub(crate) const NAME: &str = "room-net";

/// Version of the code that prepares the input and answers from the maps; part of the digest of the model.
const VERSION: u32 = 1;

/// Width and height of the network's input and maps, in pixels.
const SIZE: [usize; 2] = [192, 144];

/// The room types of the network's last output, in its order.
const ROOMS: [&str; 6] = ["bedroom", "bathroom", "kitchen", "living room", "dining room", "office"];

/// Number of cached predictions. A few are enough, because questions about one image follow each other.
const PREDICTIONS: usize = 16;

/// The network and the rules by which its maps answer a question.
pub(crate) struct RoomNet {
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
    pub(crate) fn new(runtime: RuntimeSearch, rules: Rules) -> Result<Arc<Self>> {
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
    pub(crate) fn model(self: &Arc<Self>, prior: Random) -> Local {
        let net = Arc::clone(self);
        let digest = Digest::from_parts([&VERSION.to_le_bytes()[..], ROOM_NET, self.rules.digest().as_bytes()]);
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
