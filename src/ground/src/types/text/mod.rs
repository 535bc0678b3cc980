//! Text: words of types, text from outside, spelling suggestions and quoting.

#[cfg(feature = "program")]
pub mod image_mark;
pub mod near_name;
mod shell;
mod shown_text;
mod toml_fault;
pub mod words;

pub use shell::shell_word;
pub use shown_text::{excerpt, is_hidden, shown, shown_in_colours, written_out};
pub use toml_fault::{TomlFault, line_at};
