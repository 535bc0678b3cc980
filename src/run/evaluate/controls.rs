//! The controls of the observer that a run asks although no flag names them: [`AddedControls`].

use super::settings::Evaluation;
use crate::engine::models::{ModelName, ModelUnderTest};
use crate::error::{Error, Result};

use crate::images::progress::Progress;
use crate::types::Control;

/// Whether a model is the control that is shown the image of another scene; the plan gives it that image.
pub(super) fn is_other_room(model: &ModelUnderTest) -> bool {
    Control::from_model_name(model.model.name()) == Some(Control::OtherRoom)
}

/// The controls that are added to a run with the observer.
#[derive(Debug, Default)]
pub(super) struct AddedControls {
    pub(super) names: Vec<ModelName>,
    /// A line about other-room; `None` if it is not added.
    line: Option<&'static str>,
}

impl AddedControls {
    /// The controls of a run: none without the observer; else the standing control at least, which is other-room or, if all frames
    /// are of one scene, the tiles of the right image in another order.
    ///
    /// # Errors
    /// If other-room is named by a flag, and there is no other scene.
    pub(super) fn new(config: &Evaluation, has_other_scene: bool) -> Result<Self> {
        let ask = &config.job.ask;
        let other_room = ModelName::Observer(Some(Control::OtherRoom));
        if !has_other_scene && ask.shows_images_to(&other_room) {
            let problem = "observer:other-room needs frames of at least two scenes";
            return Err(Error::usage("--model", problem));
        }
        if !ask.shows_images_to(&ModelName::Observer(None)) {
            return Ok(Self::default());
        }
        let standing = if has_other_scene {
            Control::OtherRoom
        } else {
            Control::Tiles
        };
        let names: Vec<ModelName> = Control::ALL
            .into_iter()
            .filter(|control| {
                let is_wanted = config.observer_controls || *control == standing;
                is_wanted && (has_other_scene || *control != Control::OtherRoom)
            })
            .map(|control| ModelName::Observer(Some(control)))
            .filter(|name| !ask.shows_images_to(name))
            .collect();
        if !has_other_scene {
            tracing::warn!(
                "all frames are of one scene, so observer:other-room is not possible; observer:tiles is asked instead: the observer \
                 with the tiles of the right image in another order; its score must be that of chance"
            );
        }
        let line = has_other_scene.then_some(
            "observer:other-room is asked too: the observer with the image of another scene; its score must be that of chance",
        );
        Ok(Self { names, line })
    }

    /// Prints what is added.
    pub(super) fn print(&self, progress: &Progress) {
        if let Some(line) = self.line {
            progress.say(line);
        }
    }
}
