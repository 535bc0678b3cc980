//! The flags of the judge ([`JudgeArgs`]), and the resolved judge with its endpoint and key ([`Judge`]).

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use crate::ask::{AccessArgs, KeyHeader, Parameters, Server, SettingsOrigin, Temperature};
use crate::engine::continuation::Continuation;
use crate::engine::models::ModelName;
use crate::engine::settings::JobArgs;
use crate::error::Result;
use crate::types::Decides;
use crate::types::manifests::JUDGES;
use darkqa_score::choice::llm_match::Protocol;

/// The flags of the judge, the model that marks the answers.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Judge")]
pub(crate) struct JudgeArgs {
    /// The model that marks the answers; default: none, answers are stored and not marked
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub judge: Option<ModelName>,
    /// How answers are judged and marks read
    #[arg(long, value_enum, default_value_t = Protocol::Upstream, add = Decides::Reply)]
    pub protocol: Protocol,
    /// The judge's endpoint; default: that of the models
    #[arg(long, value_name = "URL", add = Decides::Reply)]
    pub judge_base_url: Option<String>,
    /// The variable that holds the key of the judge's endpoint, or none; default: that of its vendor, or
    /// without --judge-base-url that of the models
    #[arg(long, value_name = "NAME|none", conflicts_with = "judge_api_key_file", add = Decides::Nothing)]
    pub judge_api_key_env: Option<String>,
    /// A file that holds the key of the judge's endpoint; default: none, a variable holds it
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub judge_api_key_file: Option<PathBuf>,
    /// The judge's sampling temperature
    #[arg(long, value_name = "T|auto|default", default_value = "0.2", add = Decides::Reply)]
    pub judge_temperature: Temperature,
    /// The maximum number of tokens of a judge's reply
    #[arg(long, value_name = "N", default_value = "32", add = Decides::Reply)]
    pub judge_max_tokens: NonZeroU32,
}

/// The model that marks the answers, with its endpoint.
#[derive(Debug)]
pub(super) struct Judge {
    pub(super) model: ModelName,
    /// The endpoint; `None` if the model is built in.
    pub(super) server: Option<Arc<Server>>,
    /// Parameters of a request; the name of the model is set later.
    pub(super) parameters: Parameters,
}

impl Judge {
    /// Continues the marks of a stored run under their keys, if the settings differ only in what may change in it.
    pub(super) fn continue_from(&mut self, run: &Continuation) {
        let ModelName::Remote(id) = &self.model else {
            return;
        };
        let own = Parameters { model: id.clone(), ..self.parameters.clone() };
        if let Some(accepted) = run.accept(JUDGES, id, &own, true) {
            self.parameters = accepted;
        }
    }
}

impl JudgeArgs {
    /// Resolves the judge and the key of its endpoint; `None` without `--judge`. The key of one endpoint is never sent
    /// to another.
    ///
    /// # Errors
    /// If the judge cannot answer open questions, or its endpoint or key is invalid.
    pub(super) fn resolve(self, job: &JobArgs, seed: Option<u64>) -> Result<Option<Judge>> {
        let Some(model) = self.judge else {
            return Ok(None);
        };
        model.require_open_answers().map_err(at_judge)?;
        if self.judge_base_url.is_none() && job.access.base_url.is_empty() {
            model.check_spelling().map_err(at_judge)?;
        }
        let mut access = job.access.clone();
        let own_access =
            self.judge_base_url.is_some() || self.judge_api_key_env.is_some() || self.judge_api_key_file.is_some();
        if own_access {
            let access_args = match self.judge_base_url {
                Some(url) => access.for_base_url(url),
                None => access,
            };
            access = AccessArgs {
                api_key_env: self.judge_api_key_env,
                api_key_file: self.judge_api_key_file,
                key_header: KeyHeader::Auto,
                ..access_args
            };
        }
        if job.money.dry_run {
            access = access.without_key();
        }
        let server = match model {
            ModelName::Remote(_) => Some(Arc::new(access.server(job.sending).map_err(at_judge)?)),
            _ => None,
        };
        Ok(Some(Judge {
            model,
            server,
            parameters: Parameters {
                temperature: self.judge_temperature,
                max_tokens: self.judge_max_tokens,
                token_field: job.parameters.token_field,
                seed,
                origin: SettingsOrigin {
                    default_temperature: job.unset.contains("judge-temperature"),
                    default_seed: job.unset.contains("sampling-seed"),
                    is_judge: true,
                    ..SettingsOrigin::default()
                },
                ..Parameters::new(String::new())
            },
        }))
    }
}

fn at_judge(e: crate::error::Error) -> crate::error::Error {
    e.at("the judge")
}
