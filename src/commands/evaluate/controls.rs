//! Controls of the observer that are added to a run without a flag: [`AddedControls`].

use super::settings::Evaluation;
use crate::engine::images::progress::Progress;
use crate::engine::models::{ModelName, ModelUnderTest};
use crate::error::{Error, Result};
use crate::types::Control;

/// True if a model is the control `observer:other-room`, which gets the image of another scene.
pub(super) fn is_other_room(model: &ModelUnderTest) -> bool {
    Control::from_model_name(model.model.name()) == Some(Control::OtherRoom)
}

/// Controls that are added to a run with the observer.
#[derive(Debug, Default)]
pub(super) struct AddedControls {
    pub(super) names: Vec<ModelName>,
    /// Line for the user about other-room; `None` if it is not possible.
    line: Option<&'static str>,
}

impl AddedControls {
    /// The controls to add: none without the observer, else at least the default control. This is other-room or, if all
    /// frames are of one scene, the image with its tiles in another order.
    ///
    /// # Errors
    /// If a flag names other-room, and all frames are of one scene.
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
        let default = if has_other_scene { Control::OtherRoom } else { Control::Tiles };
        let names: Vec<ModelName> = Control::ALL
            .into_iter()
            .filter(|control| {
                let is_wanted = config.observer_controls || *control == default;
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

    /// Prints the line about other-room.
    pub(super) fn print(&self, progress: &Progress) {
        if let Some(line) = self.line {
            progress.print_on_terminal(line);
        }
    }
}
