//! Request settings, which each model of a models file can override: [`AskingArgs`].

use clap::builder::Resettable;
use clap::{ArgAction, Args, Command, FromArgMatches as _, value_parser};

use darkqa_ask::{AccessArgs, Constrain, Parameters, RequestArgs, Sending};
use darkqa_base::error::{Error, Result};

/// How a model is asked: the flags, and the same settings in a file of models.
#[derive(Debug, Clone, Args)]
pub struct AskingArgs {
    /// Parameters of the model.
    #[command(flatten)]
    pub parameters: Parameters,
    /// Fields added to requests or left out.
    #[command(flatten)]
    pub request: RequestArgs,
    /// Endpoint and its key.
    #[command(flatten)]
    pub access: AccessArgs,
    /// Concurrency, timeouts, retries and rate limits.
    #[command(flatten)]
    pub sending: Sending,
    /// The constraint on replies.
    #[arg(long, value_enum, default_value_t)]
    pub constrain: Constrain,
    /// Whether the probabilities of choices are asked for.
    #[arg(long)]
    pub probabilities: bool,
    /// The seed of the server's sampling.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Names of headers that decide replies.
    #[arg(long)]
    pub reply_headers: Vec<String>,
}

impl AskingArgs {
    /// The default settings.
    ///
    /// # Errors
    /// None in practice: every flag has a default.
    pub fn defaults() -> Result<Self> {
        let command = Self::augment_args(Command::new("model").no_binary_name(true));
        let matches = command.try_get_matches_from([""; 0]);
        let args = matches.and_then(|matches| Self::from_arg_matches(&matches));
        args.map_err(|e| Error::usage("model", line(&e)))
    }

    /// The names of all settings, as flags.
    pub(super) fn flags() -> Vec<String> {
        let command = command();
        command.get_arguments().filter_map(|arg| arg.get_long()).map(str::to_owned).collect()
    }

    /// Removes the API key, because it belongs to another address.
    pub(super) fn forget_key(&mut self) {
        (self.access.api_key_env, self.access.api_key_file) = (None, None);
    }

    /// Removes all headers.
    pub(super) fn forget_headers(&mut self) {
        self.access.header.clear();
        self.access.header_env.clear();
    }

    /// Replaces the settings named by these command-line words, and keeps the others. A switch is written
    /// `--flag=true`.
    ///
    /// # Errors
    /// The message of the parser if a value is invalid.
    pub(super) fn update(&mut self, words: &[String]) -> Result<(), String> {
        let matches = command().try_get_matches_from(words).map_err(|e| line(&e))?;
        // A source of the key or of the system message replaces the other source.
        if matches.contains_id("api_key_env") || matches.contains_id("api_key_file") {
            self.forget_key();
        }
        if matches.contains_id("system") || matches.contains_id("system_file") {
            (self.request.system, self.request.system_file) = (None, None);
        }
        self.update_from_arg_matches(&matches).map_err(|e| line(&e))
    }
}

/// A parser of settings that overrides others. No flag has a default, so that only named settings change.
fn command() -> Command {
    let command = Command::new("model").no_binary_name(true).disable_help_flag(true);
    AskingArgs::augment_args_for_update(command).mut_args(|arg| {
        let arg = arg.required(false).default_value(Resettable::Reset);
        match arg.get_action() {
            ArgAction::SetTrue => arg.action(ArgAction::Set).num_args(1).value_parser(value_parser!(bool)),
            _ => arg,
        }
    })
}

/// The message of a parser error, on one line.
fn line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty() && !line.starts_with("For more"))
        .collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_named_settings_change() {
        let mut args = AskingArgs::defaults().unwrap();
        args.access.allow_http = true;
        args.sending.retries = 9;
        args.parameters.top_p = Some(0.5);
        let before = format!("{args:?}");
        args.update(&[]).unwrap();
        assert_eq!(format!("{args:?}"), before);
        args.update(&["--allow-http=false".into(), "--rpm=30".into()]).unwrap();
        assert!(!args.access.allow_http);
        assert_eq!(args.sending.quota.requests.unwrap().get(), 30);
        assert_eq!((args.sending.retries, args.parameters.top_p), (9, Some(0.5)));
        assert_eq!(args.sending.timeout, Sending::default().timeout);
        let error = args.update(&["--rpm=0".into()]).unwrap_err();
        assert!(error.contains("--rpm"), "{error}");
    }

    #[test]
    fn one_key_replaces_the_other() {
        let mut args = AskingArgs::defaults().unwrap();
        args.access.api_key_env = Some("A".into());
        args.update(&["--temperature=1".into()]).unwrap();
        assert_eq!(args.access.api_key_env.as_deref(), Some("A"));
        args.update(&["--api-key-file=f".into()]).unwrap();
        assert_eq!(args.access.api_key_env, None);
        assert!(args.access.api_key_file.is_some());
        args.forget_key();
        assert_eq!(args.access.api_key_file, None);
    }
}
