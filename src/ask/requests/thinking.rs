//! Setting whether a model thinks before it answers ([`Thinking`]), and the request fields for it ([`ThinkingSwitch`]).
//!
//! The fields differ between vendors; `thinking.toml` lists them by host.

use std::sync::LazyLock;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::ask::endpoints::BaseUrl;
use crate::error::{Error, Result};
use crate::types::flags::flag_words;

/// The built-in table.
static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let text = include_str!("../thinking.toml");
    toml::from_str(text).unwrap_or_else(|e| unreachable!("a test reads thinking.toml: {e}"))
});

/// Whether a model thinks before it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Thinking {
    /// It answers at once
    Off,
    /// It thinks first
    On,
}

flag_words!(Thinking);

/// Table of servers, with its date.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Table {
    #[expect(dead_code, reason = "for readers of the table")]
    as_of: String,
    server: Vec<ServerRow>,
}

/// Servers with the same switch.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ServerRow {
    /// Suffixes of their host names.
    #[serde(default)]
    hosts: Vec<String>,
    /// Ports of such servers on this machine.
    #[serde(default)]
    ports: Vec<u16>,
    off: Option<ThinkingSwitch>,
    on: Option<ThinkingSwitch>,
}

/// Request fields that turn thinking on or off.
#[derive(Debug, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ThinkingSwitch {
    /// Reasoning effort; `None` if the switch does not use it.
    pub(super) effort: Option<String>,
    /// Top-level fields of the body.
    #[serde(default)]
    pub(super) body: Map<String, Value>,
}

impl Thinking {
    /// Switch for the server at a base URL.
    ///
    /// # Errors
    /// [`Error::Usage`] if the switch of the server is unknown.
    pub(super) fn switch_for(self, base: &BaseUrl) -> Result<&'static ThinkingSwitch> {
        let servers = &TABLE.server;
        servers
            .iter()
            .find(|row| row.matches(base))
            .or_else(|| servers.iter().find(|row| row.is_fallback()))
            .and_then(|row| match self {
                Self::Off => row.off.as_ref(),
                Self::On => row.on.as_ref(),
            })
            .ok_or_else(|| {
                let problem = format_args!(
                    "how to turn thinking {self} at {base} is not known; set it with --reasoning-effort, in the server's words"
                );
                Error::usage("--thinking", problem)
            })
    }
}

impl ServerRow {
    /// True if the row lists the host, or the port of a server on this machine.
    fn matches(&self, base: &BaseUrl) -> bool {
        let has_host = self.hosts.iter().any(|suffix| {
            base.host() == suffix.trim_start_matches('.')
                || (suffix.starts_with('.') && base.host().ends_with(suffix.as_str()))
        });
        has_host || (base.is_loopback() && base.port().is_some_and(|port| self.ports.contains(&port)))
    }

    /// True for the row of all servers that no other row lists.
    fn is_fallback(&self) -> bool {
        self.hosts.is_empty() && self.ports.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn switch_for(base: &str, thinking: Thinking) -> Result<&'static ThinkingSwitch> {
        thinking.switch_for(&base.parse().unwrap())
    }

    #[test]
    fn each_server_has_its_switch() {
        let template = json!({"chat_template_kwargs": {"enable_thinking": false}});
        for (base, effort, body) in [
            ("https://api.openai.com/v1", Some("none"), json!({})),
            ("https://r.openai.azure.com/openai/v1", Some("none"), json!({})),
            ("https://dashscope-intl.aliyuncs.com/compatible-mode/v1", None, json!({"enable_thinking": false})),
            ("https://openrouter.ai/api/v1", None, json!({"reasoning": {"enabled": false}})),
            ("http://127.0.0.1:11434/v1", Some("none"), json!({})),
            ("http://127.0.0.1:8000/v1", None, template.clone()),
            // Ports count only on this machine, and suffixes only as whole domains.
            ("http://gpu7:11434/v1", None, template.clone()),
            ("https://api.openai.com.example/v1", None, template),
        ] {
            let switch = switch_for(base, Thinking::Off).unwrap();
            assert_eq!(switch.effort.as_deref(), effort, "{base}");
            assert_eq!(json!(switch.body), body, "{base}");
        }
    }

    #[test]
    fn unknown_switches_are_errors() {
        for (base, thinking) in
            [("https://api.mistral.ai/v1", Thinking::Off), ("https://api.openai.com/v1", Thinking::On)]
        {
            let error = switch_for(base, thinking).unwrap_err().to_string();
            assert!(error.contains("--thinking"), "{error}");
            assert!(error.contains("--reasoning-effort"), "{error}");
        }
    }

    /// No switch is empty or sets a field of the program.
    #[test]
    fn switches_set_only_thinking_fields() {
        let program_fields =
            ["model", "messages", "input", "stream", "temperature", "max_tokens", "reasoning_effort", "logprobs"];
        let fallbacks = TABLE.server.iter().filter(|row| row.is_fallback());
        assert_eq!(fallbacks.count(), 1);
        for row in &TABLE.server {
            for switch in row.off.iter().chain(&row.on) {
                assert!(switch.effort.is_some() || !switch.body.is_empty(), "{row:?}");
                assert!(program_fields.iter().all(|field| !switch.body.contains_key(*field)));
            }
        }
    }
}
