//! The flags that decide the images of a run, as typed. A manifest stores them, and [`ImageFlags`] parses them again.

use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, CommandFactory as _, Parser};
use serde_json::Value;

use crate::data::{DataArgs, DecodeArgs, SceneArgs};
use crate::engine::images::frames::WalkArgs;
use crate::error::{Error, Result};
use crate::pictures::ImageArgs;
use crate::types::Decides;
use crate::types::flags::flag_spelling;
use darkqa_enhance::{EnhancedFolder, SizeArgs};
use darkqa_light::{CameraArgs, SensorArgs};

/// The repeatable flag whose values replace those of an earlier call; other repeatable flags add to them.
const REPLACED: &str = "data";

/// Flag values by long name: a text, a list of texts, or `true` for a switch.
pub(crate) type ImageWords = BTreeMap<String, Value>;

/// All flags that decide images.
#[derive(Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true, mut_arg("frames", |arg| arg.required(false)))]
pub(crate) struct ImageFlags {
    #[command(flatten)]
    pub(crate) data: DataArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) decode: DecodeArgs,
    #[command(flatten)]
    pub(crate) sensor: SensorArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[arg(long, add = Decides::Trials)]
    pub(crate) llie: Vec<PathBuf>,
    #[arg(long, add = Decides::Trials)]
    pub(crate) enhanced: Vec<EnhancedFolder>,
    #[command(flatten)]
    pub(crate) size: SizeArgs,
    #[command(flatten)]
    pub(crate) images: ImageArgs,
    #[arg(long, add = Decides::Pixels)]
    pub(crate) max_side: Option<NonZeroU32>,
    #[command(flatten)]
    pub(crate) walk: Option<WalkArgs>,
}

impl ImageFlags {
    /// Parses the flags that a manifest stores.
    pub(crate) fn read(words: &ImageWords) -> Result<Self, String> {
        let flags = words.iter().flat_map(|(flag, value)| match value {
            Value::Bool(true) => vec![format!("--{flag}")],
            Value::Array(list) => list.iter().map(|value| format!("--{flag}={}", flag_text(value))).collect(),
            value => vec![format!("--{flag}={}", flag_text(value))],
        });
        Self::try_parse_from(flags)
            .map_err(|e| format!("this version cannot read the image flags in its manifest: {e}"))
    }
}

/// The text of a flag value: a string without its quotes, other values as JSON.
fn flag_text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The image flags that were typed in a call. A repeatable flag is included even if only its default is set, because a
/// later call may add values.
///
/// # Errors
/// If a value is not valid Unicode, so that a manifest cannot store it.
pub(crate) fn typed_flags(matches: &ArgMatches) -> Result<ImageWords> {
    let flags = ImageFlags::command();
    let mut words = ImageWords::new();
    for argument in flags.get_arguments() {
        let id = argument.get_id().as_str();
        let (flag, action) = (argument.get_long().unwrap_or(id), argument.get_action());
        let is_repeatable = matches!(action, ArgAction::Append) && id != REPLACED;
        let source = match matches.try_contains_id(id) {
            Ok(true) => matches.value_source(id),
            _ => None,
        };
        if source != Some(ValueSource::CommandLine) && !(is_repeatable && source.is_some()) {
            continue;
        }
        let mut texts = matches
            .get_raw(id)
            .into_iter()
            .flatten()
            .map(|text| Some(text.to_str()?.into()))
            .collect::<Option<Vec<Value>>>()
            .ok_or_else(|| {
                let problem = "cannot be stored in the manifest: the value is not valid Unicode";
                Error::usage(flag_spelling(flag), problem)
            })?;
        let value = match texts.pop() {
            _ if !action.takes_values() => Value::Bool(true),
            Some(last) if is_repeatable || !texts.is_empty() => Value::Array([texts, vec![last]].concat()),
            Some(last) => last,
            None => continue,
        };
        words.insert(flag.to_owned(), value);
    }
    Ok(words)
}
