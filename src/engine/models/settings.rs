//! Validated settings of the models of a run: [`AskSettings`], with one [`ModelSettings`] for each model.
//!
//! Changes to the list of models by flags: `--set` ([`apply_set`]) and `--only` ([`retain_only`]).

use std::collections::BTreeSet;
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::asking::AskingArgs;
use super::entry::{ModelEntry, check_keys, flag_of};
use super::file::{Keys, Located, ModelsFile};
use super::name::{ModelArgs, ModelName};
use super::trust::{self, Trust};
use crate::reply_checks::Continuation;
use darkqa_ask::{AccessArgs, Parameters, Price, Sending, Server};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{JUDGES, Views};
use darkqa_base::types::{ListedModel, View};
use darkqa_runs::shard::Shard;

/// One model of a run, with the settings of its requests.
#[derive(Debug, Clone)]
pub struct ModelSettings {
    /// Name in records and tables.
    pub name: String,
    pub id: ModelName,
    /// With or without images.
    pub view: View,
    /// Parameters of every request.
    pub parameters: Parameters,
    /// The endpoint; `None` for a built-in model. Models with the same endpoint and rate limits share one.
    pub server: Option<Arc<Server>>,
    /// The model's own price; `None` for the price in the table.
    pub price: Option<Price>,
    /// Number of questions that the model is asked; `None` for all.
    pub limit: Option<usize>,
}

/// The models of a run.
#[derive(Debug)]
pub struct AskSettings {
    /// Models of the models file in its order, followed by those that flags name.
    pub models: Vec<ModelSettings>,
    /// Content of the models file for the manifest; `None` without a file.
    pub file: Option<FileNote>,
}

/// Content of a models file for the manifest.
#[derive(Debug)]
pub struct FileNote {
    /// Resolved settings of the models that are asked, without secrets.
    pub resolved: Value,
    /// All models of the file in its order, followed by those that flags name.
    pub listed: Vec<ListedModel>,
}

/// Inputs to [`AskSettings::resolve`] besides the flags of models and requests.
#[derive(Debug, Clone, Copy)]
pub struct ResolveContext<'a> {
    /// Long names of the flags on the command line, without flags that variables or files set.
    pub typed: &'a BTreeSet<String>,
    pub shard: Shard,
    /// Number of shards that run at once; `None` for all.
    pub workers: Option<NonZeroU32>,
    /// Controls whether API keys are read.
    pub keys: KeyUse,
    /// The file or folder of the data, with which a models file may have come.
    pub data: Option<&'a Path>,
    /// Models that are also asked without images.
    pub text_baseline: TextBaseline,
}

/// Selects the models that are asked both with and without images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TextBaseline {
    /// Models marked by a flag or in the models file.
    #[default]
    AsMarked,
    /// All models.
    Always,
}

/// Need for API keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyUse {
    /// Requests are sent, so a missing key is an error.
    Needed,
    /// Nothing is sent, and no key is read.
    NotNeeded,
}

impl AskSettings {
    /// The views of each model, by name.
    pub fn views(&self) -> Views {
        let mut views = Views::new();
        for model in &self.models {
            views.entry(model.name.clone()).or_default().insert(model.view);
        }
        views
    }

    /// Resolves the models of these flags and of the models file that they name. Reads the API keys that the models
    /// need.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag, or the line of the file, that cannot be used.
    pub fn resolve(args: &ModelArgs, asking: &AskingArgs, context: ResolveContext<'_>) -> Result<Self> {
        let view = if args.blind { View::Blind } else { View::Image };
        let file = args.models.as_deref().map(ModelsFile::read).transpose()?;
        let mut entries = match &file {
            Some(file) => entries_from_file(file, view, asking, context.typed)?,
            None => Vec::new(),
        };
        if let Some(file) = &file {
            let trust = if args.trust_models { Trust::Stated } else { Trust::ByLocation };
            trust::check(file, &entries, asking, context.data, trust)?;
        }
        refuse_models_of_file(&entries, &args.blind_model)?;
        entries.extend(args.model.iter().map(|name| ModelEntry::from_flag(name.clone(), view, asking.clone())));
        entries.extend(
            args.blind_model.iter().map(|name| ModelEntry::from_flag(name.clone(), View::Blind, asking.clone())),
        );
        for text in &args.set {
            apply_set(&mut entries, text)?;
        }
        if context.text_baseline == TextBaseline::Always {
            add_text_baselines(&mut entries);
        }
        let listed: Vec<ListedModel> =
            entries.iter().map(|entry| ListedModel { name: entry.name.clone(), group: entry.group.clone() }).collect();
        retain_only(&mut entries, &args.only)?;
        if asking.access.base_url.is_empty() {
            entries
                .iter()
                .filter(|entry| entry.place.is_none())
                .map(|entry| &entry.id)
                .try_for_each(ModelName::check_spelling)?;
        }
        let (mut models, mut servers, mut notes) = (Vec::new(), Servers::default(), Vec::new());
        for entry in &entries {
            let resolved = resolve(entry, context, &mut servers)?;
            notes.push(manifest_note(entry, &resolved));
            models.extend(entry.views.iter().map(|view| ModelSettings { view: *view, ..resolved.clone() }));
        }
        refuse_same_names(&models)?;
        Ok(Self { models, file: file.map(|_| FileNote { resolved: json!(notes), listed }) })
    }

    /// Adapts the settings to a stored run, so that settings that may change in it do not change its trial keys. Models
    /// whose settings the run has, under this or another name, are left as they are.
    pub fn continue_from(&mut self, run: &Continuation) {
        let Some(stored) = run.columns.get("model") else {
            return;
        };
        for model in &mut self.models {
            let ModelName::Remote(id) = &model.id else {
                continue;
            };
            let parameters = Parameters { model: id.clone(), ..model.parameters.clone() };
            if stored.values().any(|column| parameters.match_column(column)) {
                continue;
            }
            // In a models file, a model with other settings is another model of the run. So is a judge of the same
            // name.
            let judges = run.columns.get(JUDGES);
            let is_judge = judges
                .and_then(|judges| judges.get(&model.name))
                .is_some_and(|judge| stored.get(&model.name) == Some(judge));
            let is_free = self.file.is_none() && !is_judge;
            if let Some(accepted) = run.accept("model", &model.name, &parameters, is_free) {
                model.parameters = accepted;
            }
        }
    }

    /// True if the model of this name is asked with images.
    pub fn shows_images_to(&self, id: &ModelName) -> bool {
        self.models.iter().any(|model| model.id == *id && model.view == View::Image)
    }

    /// The endpoints, each once.
    pub fn servers(&self) -> Vec<&Arc<Server>> {
        let mut servers: Vec<&Arc<Server>> = Vec::new();
        for server in self.models.iter().filter_map(|model| model.server.as_ref()) {
            if !servers.iter().any(|known| Arc::ptr_eq(known, server)) {
                servers.push(server);
            }
        }
        servers
    }
}

/// Adds the view without images to every model that does not have it.
fn add_text_baselines(entries: &mut [ModelEntry]) {
    let blind: BTreeSet<String> =
        entries.iter().filter(|entry| entry.views.contains(&View::Blind)).map(|entry| entry.name.clone()).collect();
    for entry in entries {
        if !blind.contains(&entry.name) {
            entry.views.push(View::Blind);
        }
    }
}

/// The models of a models file. Flags on the command line override its `[defaults]`, and its `[[model]]` tables
/// override the flags.
fn entries_from_file(
    file: &ModelsFile,
    view: View,
    asking: &AskingArgs,
    typed: &BTreeSet<String>,
) -> Result<Vec<ModelEntry>> {
    check_keys(&file.defaults, true)?;
    let is_typed = |key: &str| match key {
        "view" => typed.contains("blind"),
        "seed" => typed.contains("sampling-seed"),
        "headers" => typed.contains("header") || typed.contains("header-env"),
        "key-env" | "key-file" => typed.contains("api-key-env") || typed.contains("api-key-file"),
        key => flag_of(key).is_some_and(|flag| typed.contains(flag)),
    };
    // An API key from the flags is not sent to an address of the file, so it does not override a key from [defaults]
    // there.
    let mut entries = Vec::new();
    let mut overridden = BTreeSet::new();
    for keys in &file.models {
        check_keys(keys, false)?;
        let defaults: Keys = file
            .defaults
            .clone()
            .into_iter()
            .filter(|(key, _)| {
                let is_api_key = matches!(&**key, "key-env" | "key-file");
                !is_typed(key) || (is_api_key && keys.contains_key("endpoints"))
            })
            .collect();
        overridden.extend(keys.keys().filter(|key| is_typed(key)).cloned());
        entries.push(ModelEntry::from_file(keys, &[&defaults, keys], view, asking.clone())?);
    }
    if !overridden.is_empty() {
        let keys: Vec<String> = overridden.into_iter().collect();
        tracing::warn!(
            "{}: models with their own {} are not changed; the flag applies to the others (--set NAME.KEY=VALUE overrides both)",
            file.path.display(),
            keys.join(", ")
        );
    }
    Ok(entries)
}

/// The endpoints of a run. Models with the same settings share one.
#[derive(Debug, Default)]
struct Servers(Vec<(AccessArgs, Sending, Arc<Server>)>);

impl Servers {
    /// The endpoint with these settings, created on the first call.
    fn get(&mut self, access: &AccessArgs, sending: Sending) -> Result<Arc<Server>> {
        let known = self.0.iter().find(|(a, s, _)| (a, *s) == (access, sending));
        if let Some((_, _, server)) = known {
            return Ok(Arc::clone(server));
        }
        let server = Arc::new(access.server(sending)?);
        self.0.push((access.clone(), sending, Arc::clone(&server)));
        Ok(server)
    }
}

/// Resolves the endpoint and parameters of a model, with the first of its views.
fn resolve(entry: &ModelEntry, context: ResolveContext<'_>, servers: &mut Servers) -> Result<ModelSettings> {
    let AskingArgs { parameters, request, access, sending, constrain, probabilities, seed, reply_headers } =
        entry.asking.clone();
    let with_place = |e: Error| match (&entry.place, e) {
        (Some(place), Error::Usage { origin, problem }) => {
            Error::usage(place, format_args!("{}: {origin}: {problem}", entry.name))
        }
        (_, e) => e,
    };
    let mut extra = request.resolve().map_err(with_place)?;
    for name in reply_headers {
        let value = plain_header(&access.header, &name);
        let problem = "no header of this name with a value in headers: only such a one can decide replies";
        let value =
            value.ok_or_else(|| with_place(Error::usage("reply-headers", format_args!("{name}: {problem}"))))?;
        extra.reply_headers.insert(name.to_lowercase(), value);
    }
    extra.deployment.clone_from(&entry.deployment);
    let parameters = Parameters { seed, constrain, probabilities, extra, ..parameters };
    if probabilities {
        parameters.require_greedy().map_err(with_place)?;
    }
    let sending = Sending { quota: context.shard.quota(sending.quota, context.workers), ..sending };
    // A dry run sends nothing, so it needs no key.
    let access = match context.keys {
        KeyUse::Needed => access,
        KeyUse::NotNeeded => access.without_key(),
    };
    let remote = matches!(entry.id, ModelName::Remote(_));
    let server = remote.then(|| servers.get(&access, sending)).transpose();
    Ok(ModelSettings {
        name: entry.name.clone(),
        id: entry.id.clone(),
        view: entry.views[0],
        parameters,
        server: server.map_err(with_place)?,
        price: entry.price,
        limit: entry.limit.map(std::num::NonZeroUsize::get),
    })
}

/// The value of a header that is not secret.
fn plain_header(headers: &[String], name: &str) -> Option<String> {
    headers
        .iter()
        .filter_map(|text| text.split_once(':'))
        .find(|(other, _)| other.trim().eq_ignore_ascii_case(name))
        .map(|(_, value)| value.trim().to_owned())
}

/// The settings of a model for the manifest, without keys, passwords and values of secret headers.
fn manifest_note(entry: &ModelEntry, resolved: &ModelSettings) -> Value {
    let access = &entry.asking.access;
    let views: Vec<String> = entry.views.iter().map(ToString::to_string).collect();
    let mut note = json!({
        "name": entry.name,
        "id": entry.id.label(),
        "group": entry.group,
        "view": views,
        "wire": resolved.parameters.wire.to_string(),
        "settings": resolved.parameters,
        "price": entry.price.map(|price| json!({"input": price.input, "output": price.output, "cached-input": price.cached_input})),
        "limit": entry.limit,
    });
    if let Some(server) = &resolved.server {
        let sending = &server.sending;
        note["endpoints"] = json!(server.addresses());
        note["key"] = json!(access.key_source(&server.replicas[0]));
        note["headers"] = json!([header_names(&access.header), header_names(&access.header_env)].concat());
        note["pace"] = json!({
            "concurrency": sending.concurrency.to_string(), "rpm": sending.quota.requests, "tpm": sending.quota.tokens,
            "timeout": sending.timeout.as_secs_f64(), "retries": sending.retries, "max-wait": sending.max_wait.as_secs_f64(),
            "patience": sending.patience.as_secs_f64(),
        });
    }
    if let Some(fields) = note["settings"].as_object_mut() {
        fields.remove("model");
        fields.retain(|_, value| !value.is_null());
    }
    if let Some(fields) = note.as_object_mut() {
        fields.retain(|_, value| !value.is_null());
    }
    note
}

fn header_names(headers: &[String]) -> Vec<String> {
    headers.iter().map(|text| text.split([':', '=']).next().unwrap_or_default().trim().to_owned()).collect()
}

/// Refuses `--blind-model` with a model of the models file, because it would be asked at another address and with other
/// settings than with images.
fn refuse_models_of_file(entries: &[ModelEntry], blind: &[ModelName]) -> Result<()> {
    for name in blind.iter().map(ModelName::label) {
        let known = entries.iter().find(|entry| entry.name == name || entry.id.label() == name);
        if let Some(ModelEntry { name, id, .. }) = known
            && matches!(id, ModelName::Remote(_))
        {
            let problem = format_args!(
                "{name} is a model of the file, and the flag would ask for it elsewhere; view = \"both\" in its table, or --set {name:?}.view=both, asks it without images, too"
            );
            return Err(Error::usage("--blind-model", problem));
        }
    }
    Ok(())
}

/// Refuses two models with the same name and view, because tables could not distinguish their replies.
fn refuse_same_names(models: &[ModelSettings]) -> Result<()> {
    for (i, model) in models.iter().enumerate() {
        let mut before = models[..i].iter();
        if before.any(|other| other.view == model.view && other.name == model.name) {
            let problem = format_args!("{} is named twice; in a file of models, give each its own name", model.name);
            return Err(Error::usage("--model", problem));
        }
    }
    Ok(())
}

/// Applies one `--set NAME.KEY=VALUE`.
///
/// # Errors
/// If no model has the name, or the key or its value is invalid.
fn apply_set(entries: &mut [ModelEntry], text: &str) -> Result<()> {
    let (place, value) =
        text.split_once('=').ok_or_else(|| Error::usage("--set", "NAME.KEY=VALUE expected, as GPT-4o.rpm=60"))?;
    // The longest matching name, because a name may contain a dot and begin with another name.
    let longest_match = entries
        .iter()
        .filter(|entry| place.strip_prefix(&*entry.name).is_some_and(|rest| rest.starts_with('.')))
        .map(|entry| entry.name.clone())
        .max_by_key(String::len);
    let Some(name) = longest_match else {
        let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
        let problem = format!("{place}: no model of this name; the models are {}", names.join(", "));
        return Err(Error::usage("--set", problem));
    };
    // A value that is not TOML is taken as a string.
    let mut parsed: toml::Table = format!("value = {value}").parse().unwrap_or_default();
    let value = parsed.remove("value").unwrap_or_else(|| toml::Value::String(value.to_owned()));
    let key = place[name.len() + 1..].replace('_', "-");
    if matches!(&*key, "name" | "id") {
        return Err(Error::usage("--set", format_args!("{key} identifies the model, and cannot be set")));
    }
    let located = Located { value, place: "--set".to_owned() };
    let keys = Keys::from([(key, located)]);
    check_keys(&keys, false)?;
    for entry in entries.iter_mut().filter(|entry| entry.name == name) {
        if keys.contains_key("endpoints") {
            // The API key belongs to the earlier address.
            entry.asking.forget_key();
        }
        entry.apply(&keys)?;
    }
    Ok(())
}

/// Keeps only the models that `--only` names.
///
/// # Errors
/// If no model has one of the names.
fn retain_only(entries: &mut Vec<ModelEntry>, only: &[String]) -> Result<()> {
    if only.is_empty() {
        return Ok(());
    }
    for name in only {
        if !entries.iter().any(|entry| entry.name == *name) {
            let names: Vec<&str> = entries.iter().map(|entry| &*entry.name).collect();
            let problem = format_args!("{name}: no model of this name; the models are {}", names.join(", "));
            return Err(Error::usage("--only", problem));
        }
    }
    entries.retain(|entry| only.contains(&entry.name));
    Ok(())
}
