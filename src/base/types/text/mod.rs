//! Text: counts with nouns, enum values as words, escaping of untrusted text, spelling suggestions and shell quoting.

mod count;
mod escape;
#[cfg(feature = "program")]
pub mod image_mark;
pub mod model_names;
pub mod near_name;
mod shell;
mod toml_fault;
pub mod words;

pub use count::{bytes, counted, hours, money, plural};
pub use escape::{escape_hidden, escape_hidden_except_styles, escape_where, excerpt, is_hidden};
pub use shell::shell_word;
pub use toml_fault::{TomlFault, line_at};
