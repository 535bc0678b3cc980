//! Names of models in flags and in models files: [`ModelName`].
//!
//! Flags that name the models to ask: [`ModelArgs`].

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use crate::observer;
use darkqa_ask::Prices;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::is_nearly;
use darkqa_base::types::{Control, Decides};

/// A model that a flag or a models file names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModelName {
    /// Built-in model that guesses at random.
    Random,
    /// Built-in model that knows the frame and answers only what the degraded pixels still show; or one of its
    /// controls.
    Observer(Option<Control>),
    /// Built-in network that answers from the pixels of the image alone.
    RoomNet,
    /// Built-in model that reads its replies from this file.
    Script(PathBuf),
    /// Model with this name at the endpoint.
    Remote(String),
}

/// First words of the names of built-in models.
const BUILT_IN: [&str; 4] = ["random", "observer", observer::NAME, "script"];

impl ModelName {
    /// True for the built-in models that answer multiple-choice questions only.
    pub(super) fn is_choice_only(&self) -> bool {
        matches!(self, Self::Random | Self::Observer(_) | Self::RoomNet)
    }

    /// Checks that the model can answer open questions.
    ///
    /// # Errors
    /// If the model answers multiple-choice questions only.
    pub fn require_open_answers(&self) -> Result<()> {
        let name = match self {
            Self::Random => "random",
            Self::Observer(_) => "observer",
            Self::RoomNet => observer::NAME,
            Self::Script(_) | Self::Remote(_) => return Ok(()),
        };
        let problem = format_args!("{name} can only choose, and these questions are open");
        Err(Error::usage("--model", problem))
    }

    /// Refuses a misspelt name of a built-in model, and a comma-separated list of names. Without this check, the images
    /// would be sent to an endpoint.
    ///
    /// # Errors
    /// If a remote model's name contains a comma, or is close to a built-in name and not in the built-in price table.
    pub fn check_spelling(&self) -> Result<()> {
        let Self::Remote(name) = self else {
            return Ok(());
        };
        let listed: Vec<&str> = name.split(',').map(str::trim).collect();
        if listed.len() > 1 {
            let flags: Vec<String> = listed.iter().map(|model| format!("--model {model}")).collect();
            let problem = format_args!(
                "{name}: several models are several flags: {}. To ask an endpoint for a model of this name: --models FILE, or --base-url",
                flags.join(" ")
            );
            return Err(Error::usage("--model", problem));
        }
        let first_word = name.split(':').next().unwrap_or(name).to_lowercase();
        let mut near = BUILT_IN.into_iter().filter(|built_in| is_nearly(&first_word, built_in));
        match near.next() {
            Some(built_in) if Prices::built_in()?.find(name).is_none() => {
                let hint = if built_in == "script" { "script:FILE" } else { built_in };
                let problem = format_args!(
                    "{name}: did you mean {hint}? To ask an endpoint for a model of this name: --models FILE, or --base-url"
                );
                Err(Error::usage("--model", problem))
            }
            _ => Ok(()),
        }
    }

    /// Name of the model in tables and folder names.
    pub fn label(&self) -> String {
        match self {
            Self::Random => "random".to_owned(),
            Self::Observer(control) => observer::name(*control),
            Self::RoomNet => observer::NAME.to_owned(),
            Self::Script(path) => {
                path.file_stem().map_or_else(|| "script".to_owned(), |stem| stem.to_string_lossy().into_owned())
            }
            Self::Remote(name) => name.clone(),
        }
    }
}

/// Maximum length of a remote model's name, in bytes (chosen): twice the longest path of a published model.
const MAX_NAME_BYTES: usize = 200;

impl FromStr for ModelName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some(control) = text.strip_prefix("observer:") {
            return Ok(Self::Observer(Some(control.parse()?)));
        }
        match text {
            "" => Err("the name of a model is empty".to_owned()),
            "random" => Ok(Self::Random),
            "observer" => Ok(Self::Observer(None)),
            observer::NAME => Ok(Self::RoomNet),
            "script" => Err("script:FILE expected, a file of replies".to_owned()),
            name => match name.strip_prefix("script:") {
                Some(path) => Ok(Self::Script(path.into())),
                None if name.len() > MAX_NAME_BYTES || name.contains(char::is_control) => {
                    Err(format!("the name of a model has at most {MAX_NAME_BYTES} bytes and no control characters"))
                }
                None => Ok(Self::Remote(name.to_owned())),
            },
        }
    }
}

/// Flags that name the models to ask.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub struct ModelArgs {
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
    pub fn is_empty(&self) -> bool {
        self.model.is_empty() && self.blind_model.is_empty() && self.models.is_none()
    }

    /// The models that flags name.
    pub fn named(&self) -> impl Iterator<Item = &ModelName> {
        self.model.iter().chain(&self.blind_model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(name: &str) -> Result<()> {
        name.parse::<ModelName>().unwrap().check_spelling()
    }

    #[test]
    fn near_misses_of_built_in_names_are_refused() {
        for wrong in ["rndom", "Random", "randmo", "obsrver", "observr:tiles", "scrip:a.jsonl", "Script:x"] {
            let error = check(wrong).unwrap_err().to_string();
            assert!(error.contains("did you mean"), "{wrong}: {error}");
        }
        let error = check("random,gpt-4o").unwrap_err().to_string();
        assert!(error.contains("--model random --model gpt-4o"), "{error}");
        for name in ["random", "observer", "script:a", "gpt-4o", "qwen:7b", "rando-vl", "o3"] {
            assert!(check(name).is_ok(), "{name}");
        }
    }

    #[test]
    fn long_or_unprintable_names_are_refused() {
        for name in ["m".repeat(200), "org/Qwen3-VL-8B é".to_owned()] {
            assert_eq!(name.parse(), Ok(ModelName::Remote(name.clone())));
        }
        for name in ["m".repeat(201), "a\u{1b}[31m".to_owned(), "a\nb".to_owned()] {
            let error = name.parse::<ModelName>().unwrap_err();
            assert!(error.contains("at most 200 bytes"), "{error}");
        }
    }
}
