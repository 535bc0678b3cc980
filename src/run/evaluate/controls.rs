//! The controls of the observer that a run asks although no flag names them: [`AddedControls`].

use super::settings::Evaluation;
use crate::error::{Error, Result};
use crate::job::models::ModelName;
use crate::job::progress::Progress;
use crate::questions::observer::controls::Control;
use crate::types::View;

/// Name of the control that is shown the image of another scene; the plan gives it that image.
pub(super) const OTHER_ROOM: &str = "observer:other-room";

/// The controls that are added to a run with the observer.
#[derive(Debug, Default)]
pub(super) struct AddedControls {
    pub(super) names: Vec<ModelName>,
    /// A line about the control that every run has; `None` if it is not asked.
    line: Option<String>,
}

impl AddedControls {
    /// The controls of a run: none without the observer, else other-room at least, if there is another scene.
    ///
    /// # Errors
    /// If other-room is named by a flag, and there is no other scene.
    pub(super) fn of(config: &Evaluation, has_other_scene: bool) -> Result<Self> {
        let ask = &config.job.ask;
        let other_room = ModelName::Observer(Some(Control::OtherRoom));
        let is_seeing = ask.view == View::Image;
        if is_seeing && !has_other_scene && ask.models.contains(&other_room) {
            let problem = format!("{OTHER_ROOM} needs frames of at least two scenes");
            return Err(Error::usage("--model", problem));
        }
        if !is_seeing || !ask.models.contains(&ModelName::Observer(None)) {
            return Ok(Self::default());
        }
        let controls = Control::ALL.into_iter().filter(|control| {
            let is_wanted = config.observer_controls || *control == Control::OtherRoom;
            is_wanted && (has_other_scene || *control != Control::OtherRoom)
        });
        let names = controls.map(|control| ModelName::Observer(Some(control)));
        let names: Vec<ModelName> = names.filter(|name| !ask.models.contains(name)).collect();
        if !has_other_scene {
            tracing::warn!(
                "the control {OTHER_ROOM} is not possible: all frames are of one scene; that the observer guesses without the \
                 right image is not shown"
            );
        }
        let line = has_other_scene.then(|| {
            format!(
                "{OTHER_ROOM} is asked too: the observer with the image of another scene; its score must be that of chance"
            )
        });
        Ok(Self { names, line })
    }

    /// Prints what is added.
    pub(super) fn say(&self, progress: &Progress) {
        if let Some(line) = &self.line {
            progress.say(line);
        }
    }
}
