//! The flags that say who is asked and how it is sent.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

/// Who is asked.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Model")]
pub struct ModelArgs {
    /// The model to ask, by its name at the endpoint; repeatable; built in: observer (frames
    /// with maps), random, script:FILE
    #[arg(long, value_name = "NAME")]
    pub model: Vec<String>,
    /// Show the models no image: words alone
    #[arg(long)]
    pub blind: bool,
    /// Add a text-only baseline by this model; repeatable
    #[arg(long, value_name = "NAME")]
    pub blind_model: Vec<String>,
    /// The endpoint; /chat/completions is appended; default: OPENAI_BASE_URL, else OpenAI's own
    #[arg(long, value_name = "URL")]
    pub base_url: Option<String>,
    /// The variable that holds the API key, or none for an endpoint without keys; default: OPENAI_API_KEY (at Azure
    /// AZURE_OPENAI_API_KEY before it)
    #[arg(long, value_name = "NAME|none", conflicts_with = "api_key_file")]
    pub api_key_env: Option<String>,
    /// A file that holds the API key
    #[arg(long, value_name = "FILE")]
    pub api_key_file: Option<PathBuf>,
    /// The header that carries the key: auto (api-key at Azure, else bearer), bearer, api-key; default: auto
    #[arg(long, value_name = "HEADER")]
    pub key_header: Option<String>,
    /// A PEM file of certificate authorities to trust besides the system's
    #[arg(long, value_name = "FILE")]
    pub ca_file: Option<PathBuf>,
    /// Send a key over unencrypted http to another machine
    #[arg(long)]
    pub allow_http: bool,
    /// Sampling temperature; default for the server's own; auto for 0, or the server's own where the model refuses any other;
    /// default: auto
    #[arg(long, value_name = "T|auto|default")]
    pub temperature: Option<String>,
    /// The most tokens of a reply, hidden reasoning included; default: 1024
    #[arg(long, value_name = "N")]
    pub max_tokens: Option<NonZeroU32>,
    /// The field that carries it: max_tokens, max_completion_tokens, none, or auto as the endpoint wants it; default: auto
    #[arg(long, value_name = "FIELD")]
    pub token_field: Option<String>,
    /// How long a reasoning model thinks, in the server's words (none, minimal, low, medium, high …)
    #[arg(long, value_name = "EFFORT")]
    pub reasoning_effort: Option<String>,
    /// How closely the server looks at images: auto, low, high; default: not sent
    #[arg(long, value_name = "DETAIL")]
    pub detail: Option<String>,
    /// What the server lets the model say: none (anything), json (an object with a letter, by response_format), choice (a
    /// letter, by structured_outputs of vLLM); other numbers than unconstrained ones; default: none
    #[arg(long, value_name = "none|json|choice")]
    pub constrain: Option<String>,
    /// A folder with prompts of your own (choice.txt, blind.txt); default: built in
    #[arg(long, value_name = "DIR")]
    pub prompts: Option<PathBuf>,
}

/// How it is sent.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Sending")]
pub struct SendingArgs {
    /// Requests in flight at once: N, fewer where the server is overloaded; or MIN-MAX, from MIN up as far as replies come no
    /// slower; default: from 8 up to 32, down to 1
    #[arg(long, value_name = "N|MIN-MAX")]
    pub concurrency: Option<String>,
    /// The most requests in a minute; default: as many as the server takes
    #[arg(long, value_name = "N")]
    pub rpm: Option<NonZeroU32>,
    /// The most tokens in a minute, of prompts and replies; default: as many as the server takes
    #[arg(long, value_name = "N")]
    pub tpm: Option<NonZeroU32>,
    /// Seconds until a try is given up, reply included; default: 120
    #[arg(long, value_name = "SECONDS")]
    pub timeout: Option<f64>,
    /// Further tries after a failure that may pass; default: 5
    #[arg(long, value_name = "N")]
    pub retries: Option<u32>,
    /// The longest wait, in seconds, that a server may ask for; default: 120
    #[arg(long, value_name = "SECONDS")]
    pub max_wait: Option<f64>,
    /// How images are sent: png (lossless) or jpeg:QUALITY; default: png
    #[arg(long, value_name = "FORMAT")]
    pub image: Option<String>,
    /// Shrink images whose longer side is longer than this, in pixels; default: never
    #[arg(long, value_name = "PIXELS")]
    pub max_side: Option<NonZeroU32>,
    /// The largest image file that is sent, in MB; default: what is known of the endpoint, else 20
    #[arg(long, value_name = "MB")]
    pub max_image: Option<f64>,
    /// Stop when this many trials have failed; default: never
    #[arg(long, value_name = "N")]
    pub max_failures: Option<NonZeroUsize>,
    /// Stop before the run has cost more than this; the same command with more goes on; default: never
    #[arg(long, value_name = "DOLLARS")]
    pub max_cost: Option<f64>,
    /// A TOML file of prices in place of the built-in table
    #[arg(long, value_name = "FILE")]
    pub prices: Option<PathBuf>,
    /// Send nothing: print requests, tokens, dollars, hours and bytes
    #[arg(long)]
    pub dry_run: bool,
}
