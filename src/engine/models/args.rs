//! Flags that name the models to ask: [`ModelArgs`].

use std::path::PathBuf;

use clap::Args;

use super::name::ModelName;
use crate::types::Decides;

/// Flags that name the models to ask.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct ModelArgs {
    /// Model to ask, by its name at the endpoint (required, or --models); repeatable; built in: room-net (a small
    /// network that sees drawn rooms), observer (frames with maps), its controls (observer:CONTROL), random,
    /// script:FILE
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub model: Vec<ModelName>,
    /// Send the models text only, no image
    #[arg(long, add = Decides::Trials)]
    pub blind: bool,
    /// Add a text-only baseline by this model; repeatable; default: none
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub blind_model: Vec<ModelName>,
    /// TOML file with one table per model: endpoint, key and settings; default: none
    #[arg(long, value_name = "FILE", add = Decides::Trials)]
    pub models: Option<PathBuf>,
    /// Ask only these models, separated by commas; default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', add = Decides::Trials)]
    pub only: Vec<String>,
    /// Trust a models file in the data folder: it may then name any variable and file
    #[arg(long, add = Decides::Nothing)]
    pub trust_models: bool,
    /// Override one key of one model in the models file; repeatable; default: none
    #[arg(long, value_name = "NAME.KEY=VALUE", add = Decides::Reply)]
    pub set: Vec<String>,
}

impl ModelArgs {
    /// True if no flag names a model or a models file.
    pub(crate) fn is_empty(&self) -> bool {
        self.model.is_empty() && self.blind_model.is_empty() && self.models.is_none()
    }

    /// The models that flags name.
    pub(crate) fn named(&self) -> impl Iterator<Item = &ModelName> {
        self.model.iter().chain(&self.blind_model)
    }
}
