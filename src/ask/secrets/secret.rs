//! API keys that are never printed ([`Secret`]), and removal of keys from text that a server sent ([`Scrub`]).
//!
//! Detection of parts of keys, and of keys in base64, in text: [`SecretParts`].
//!
//! Removal of keys from replies, and limits on the length of their texts: [`without_secrets`].
//!
//! Check of `--extra-body` for secrets: [`refuse_secrets`].

use std::collections::HashSet;
use std::fmt;
use std::ops::Range;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use serde_json::{Map, Value};

use super::key_form::{is_key_in_place_of_file, is_key_object, is_secret_name, is_secret_value, is_shell_text};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Finish, OtherField, Reply, TokenChances, TokenPosition};

/// Maximum size of a key file, in bytes. Chosen: twice the longest tokens.
const MAX_FILE: u64 = 4096;

/// An API key that is never printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// Creates a key from a text, without surrounding white space; `origin` is its variable or file, for errors.
    ///
    /// # Errors
    /// If the key is empty or has characters other than visible ASCII, which an HTTP header cannot carry. The error
    /// does not show the key.
    pub fn new(text: &str, origin: &str) -> Result<Self> {
        let key = text.trim();
        if key.is_empty() {
            return Err(Error::usage(origin, "the key is empty; for an endpoint without keys use --api-key-env none"));
        }
        if !key.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(Error::usage(
                origin,
                "the key has spaces or characters that an HTTP header cannot carry; it must be one line of visible ASCII",
            ));
        }
        if is_shell_text(key) {
            return Err(Error::usage(
                origin,
                "the key is in quotation marks, or has NAME= before it; leave only the key itself",
            ));
        }
        Ok(Self(key.to_owned()))
    }

    /// Reads a key from a file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a single line of visible ASCII, such as a file named by mistake. The error
    /// shows neither its content nor a key in place of the path.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = files::at_most(path, MAX_FILE).map_err(|error| {
            if path.to_str().is_some_and(is_key_in_place_of_file) {
                Error::usage(
                    "--api-key-file",
                    "the name of a file expected; this value looks like a key and is not shown here: write it to a file, and name that file",
                )
            } else {
                error
            }
        })?;
        let origin = format!("--api-key-file {}", path.display());
        let text = String::from_utf8_lossy(&bytes);
        if text.contains("-----BEGIN") {
            let problem = "this is a private key or a certificate, not an API key; nothing of it was sent";
            return Err(Error::usage(origin, problem));
        }
        Self::new(text.trim_start_matches('\u{feff}'), &origin)
    }

    /// The key as plain text, for HTTP headers.
    pub fn expose(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

/// Maximum length of a line of server text, in characters; chosen.
const MAX_LINE: usize = 300;

/// Number of bytes of a server text to inspect for such a line; chosen.
const MAX_READ: usize = 64 << 10;

/// Minimum length of a secret to remove, in bytes. Shorter ones are placeholders such as `x` for servers that accept
/// any key; their removal would damage ordinary words.
const MIN_SECRET: usize = 4;

/// Minimum length of a secret to remove from the reply of a model, in bytes. Real keys are longer, and an answer may
/// contain a shorter word.
const MIN_SECRET_IN_REPLY: usize = 16;

/// Filter that makes the text of a server safe for terminals, logs and tables: removes secrets and control characters,
/// and shortens it.
#[derive(Clone, Default)]
pub struct Scrub {
    /// Secrets, longest first: if one secret contains another, no part of the longer one must remain.
    secrets: Vec<String>,
    /// Parts of the secrets that are long enough for [`MIN_SECRET_IN_REPLY`].
    parts: SecretParts,
}

impl Scrub {
    /// Creates a filter for these secrets.
    pub fn new(secrets: impl IntoIterator<Item = String>) -> Self {
        let mut secrets: Vec<String> = secrets.into_iter().filter(|secret| secret.len() >= MIN_SECRET).collect();
        secrets.sort_by_key(|secret| std::cmp::Reverse(secret.len()));
        secrets.dedup();
        let parts = SecretParts::new(keys(&secrets));
        Self { secrets, parts }
    }

    /// This filter, which also removes another secret.
    pub fn with(&self, secret: String) -> Self {
        Self::new(self.secrets.iter().cloned().chain([secret]))
    }

    /// True if there are no secrets to remove.
    pub fn is_empty(&self) -> bool {
        self.secrets.is_empty()
    }

    /// Removes keys, whole, in parts or in base64, from the reply of a model; the rest is unchanged.
    pub(super) fn reply(&self, text: String) -> String {
        self.parts.masked(self.without_whole_keys(text))
    }

    /// Removes keys from a line of JSON. Each string is filtered alone. Ids of requests in a batch are not searched for
    /// parts of keys.
    pub fn json_line(&self, line: String) -> String {
        let line = self.without_whole_keys(line);
        let parts: Vec<&str> = line.split('"').collect();
        parts
            .iter()
            .enumerate()
            .map(|(index, part)| {
                let is_id = index >= 2 && parts[index - 2] == "custom_id";
                if is_id { (*part).to_owned() } else { self.parts.masked((*part).to_owned()) }
            })
            .collect::<Vec<_>>()
            .join("\"")
    }

    /// Replaces whole keys, but not parts of them.
    fn without_whole_keys(&self, text: String) -> String {
        keys(&self.secrets).fold(text, |text, key| if text.contains(key) { text.replace(key, MASK) } else { text })
    }

    /// Puts a text on one line of at most 300 characters, without secrets and hidden characters.
    pub fn line(&self, text: &str) -> String {
        let text = &text[..text.floor_char_boundary(MAX_READ)];
        let visible: String = text.chars().filter(|c| !is_hidden(*c)).collect();
        let words: Vec<&str> = visible.split_whitespace().collect();
        let mut line = words.join(" ");
        // Shorten last: otherwise the first half of a secret could remain.
        for secret in &self.secrets {
            line = line.replace(secret, MASK);
        }
        let line = self.parts.masked(line);
        match line.char_indices().nth(MAX_LINE) {
            None => line,
            Some((end, _)) => format!("{}…", &line[..end]),
        }
    }
}

/// Secrets that are long enough to remove from replies.
fn keys(secrets: &[String]) -> impl Iterator<Item = &str> {
    secrets.iter().map(String::as_str).filter(|secret| secret.len() >= MIN_SECRET_IN_REPLY)
}

/// True for control characters other than white space, and for characters that reverse or hide text.
fn is_hidden(c: char) -> bool {
    (c.is_control() && !c.is_whitespace())
        || matches!(c, '\u{200B}'..='\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2060}'..='\u{2069}' | '\u{FEFF}')
}

impl fmt::Debug for Scrub {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Scrub({} secrets)", self.secrets.len())
    }
}

/// Number of consecutive letters and digits that identify a part of a key; chosen. A random text of 64 kB contains such
/// a part with a probability of 1e-6.
const PART: usize = 8;

/// Minimum length of a part without digits; chosen. Keys of gateways contain words that also occur in replies.
const MIN_WORD_PART: usize = 10;

/// Replacement of a key.
const MASK: &str = "[secret]";

/// All sequences of [`PART`] consecutive letters and digits of keys, in plain text and in base64; in lower case.
#[derive(Clone, Default)]
pub(super) struct SecretParts(HashSet<[u8; PART]>);

impl SecretParts {
    /// Collects the parts of these keys.
    pub(super) fn new<'s>(keys: impl Iterator<Item = &'s str>) -> Self {
        let mut parts = HashSet::new();
        for key in keys {
            let in_base64 = (0..3).map(|offset| base64_letters(key, offset));
            for form in in_base64.chain([key.to_owned()]) {
                let letters: Vec<u8> = letters(&form).map(|letter| letter.value).collect();
                let windows = letters.windows(PART);
                parts.extend(windows.filter_map(|part| <[u8; PART]>::try_from(part).ok()));
            }
        }
        Self(parts)
    }

    /// Replaces each part by `[secret]`, including any other characters between its letters.
    pub(super) fn masked(&self, text: String) -> String {
        let ranges = self.find(&text);
        if ranges.is_empty() {
            return text;
        }
        let mut masked = String::with_capacity(text.len());
        let mut copied = 0;
        for range in ranges {
            masked += &text[copied..range.start];
            masked += MASK;
            copied = range.end;
        }
        masked + &text[copied..]
    }

    /// Byte ranges of the parts in a text.
    fn find(&self, text: &str) -> Vec<Range<usize>> {
        if self.0.is_empty() {
            return Vec::new();
        }
        let letters: Vec<SecretLetter> = letters(text).collect();
        let mut runs: Vec<Range<usize>> = Vec::new();
        for (index, window) in letters.windows(PART).enumerate() {
            let part: [u8; PART] = std::array::from_fn(|i| window[i].value);
            if !self.0.contains(&part) {
                continue;
            }
            match runs.last_mut() {
                Some(run) if run.end >= index => run.end = index + PART,
                _ => runs.push(index..index + PART),
            }
        }
        runs.into_iter()
            .map(|run| &letters[run])
            .filter(|run| {
                let has_digit = run.iter().any(|letter| letter.value.is_ascii_digit());
                let has_letter = run.iter().any(|letter| letter.value.is_ascii_alphabetic());
                (has_digit && has_letter) || run.len() >= MIN_WORD_PART
            })
            .map(|run| run[0].start..run[run.len() - 1].end)
            .collect()
    }
}

/// Base64 encoding of a key after `offset` unknown bytes, without the letters that depend on other bytes.
fn base64_letters(key: &str, offset: usize) -> String {
    let bytes = [&[0; 2][..offset], key.as_bytes()].concat();
    let encoded = STANDARD_NO_PAD.encode(&bytes);
    let unknown = usize::from(!bytes.len().is_multiple_of(3));
    let known = (offset * 8).div_ceil(6)..encoded.len() - unknown;
    encoded[known].to_owned()
}

/// Letter or digit in a text.
struct SecretLetter {
    /// ASCII code, in lower case.
    value: u8,
    /// Byte offset of its start.
    start: usize,
    /// Byte offset of its end.
    end: usize,
}

/// ASCII letters and digits of a text, including escaped ones such as `\u0073` in JSON or `%73` in a URL. The letter of
/// other escapes, such as `\n`, does not count.
fn letters(text: &str) -> impl Iterator<Item = SecretLetter> {
    let bytes = text.as_bytes();
    let mut start = 0;
    std::iter::from_fn(move || {
        while start < bytes.len() {
            let (value, length) = letter(&bytes[start..]);
            let end = start + length;
            let found =
                value.is_ascii_alphanumeric().then(|| SecretLetter { value: value.to_ascii_lowercase(), start, end });
            start = end;
            if found.is_some() {
                return found;
            }
        }
        None
    })
}

/// First character of these bytes, unescaped, and its length in bytes.
fn letter(bytes: &[u8]) -> (u8, usize) {
    match bytes {
        [b'\\', b'u', b'0', b'0', ..] => escaped(bytes, 4..6).unwrap_or((0, 1)),
        [b'\\', other, ..] if other.is_ascii() => (0, 2),
        [b'%', ..] => escaped(bytes, 1..3).unwrap_or((0, 1)),
        _ => (bytes[0], 1),
    }
}

/// The byte with this hexadecimal code, and the end of the code.
fn escaped(bytes: &[u8], digits: Range<usize>) -> Option<(u8, usize)> {
    let end = digits.end;
    let digits = std::str::from_utf8(bytes.get(digits)?).ok()?;
    let code = u8::from_str_radix(digits, 16).ok()?;
    Some((code, end))
}

/// Maximum length of the text of a recorded reply, in bytes; chosen: four times a reply of 4,096 tokens.
const MAX_TEXT: usize = 64 << 10;

/// Maximum length of the note about omitted bytes, in bytes.
const MAX_NOTE: usize = 64;

/// Maximum length of the name of a model or provider, and of a token, in bytes; chosen.
const MAX_NAME: usize = 200;

/// Removes keys that a server or a model repeats in a reply, and limits the length of its texts.
pub(crate) fn without_secrets(reply: Reply, scrub: &Scrub) -> Reply {
    let name = |mut name: String| {
        name = scrub.reply(name);
        name.truncate(name.floor_char_boundary(MAX_NAME));
        name
    };
    Reply {
        // Shorten last: otherwise a part of a key could remain.
        text: shortened(scrub.reply(reply.text)),
        refusal: reply.refusal.map(|text| shortened(scrub.reply(text))),
        served_model: reply.served_model.map(name),
        provider: reply.provider.map(name),
        finish: match reply.finish {
            Finish::Other(reason) => Finish::Other(scrub.line(&reason)),
            finish => finish,
        }
        .shorten(),
        chances: reply.chances.map(|chances| map_tokens(chances, name)),
        other_field: reply
            .other_field
            .map(|field| OtherField { name: name(field.name), text: shortened(scrub.reply(field.text)) }),
        ..reply
    }
}

/// Cuts the middle of a text longer than [`MAX_TEXT`] and replaces it by a note. The end remains, because a long answer
/// states its choice there.
fn shortened(text: String) -> String {
    if text.len() <= MAX_TEXT {
        return text;
    }
    let half = (MAX_TEXT - MAX_NOTE) / 2;
    let start = text.floor_char_boundary(half);
    let end = text.ceil_char_boundary(text.len() - half);
    let omitted = end - start;
    format!("{}\n[… {omitted} bytes omitted …]\n{}", &text[..start], &text[end..])
}

/// Applies a function to all tokens.
fn map_tokens(chances: TokenChances, map: impl Fn(String) -> String) -> TokenChances {
    TokenChances {
        positions: chances
            .positions
            .into_iter()
            .map(|position| TokenPosition {
                likeliest: position.likeliest.into_iter().map(|(token, logprob)| (map(token), logprob)).collect(),
                token: map(position.token),
            })
            .collect(),
        ..chances
    }
}

/// Suffixes of field names whose values are always secrets; lower-case letters and digits only.
const SECRET_SUFFIXES: [&str; 9] = [
    "privatekey",
    "apikey",
    "accesskey",
    "secretkey",
    "secret",
    "password",
    "authorization",
    "accesstoken",
    "authtoken",
];

/// Minimum length at which the value of a field with a secret-looking name counts as a secret; chosen.
const MIN_LENGTH: usize = 20;

/// Checks that no field, at any depth, looks like a secret: bodies are written to the manifest and to batch files.
///
/// # Errors
/// [`Error::Usage`] with the name of a field that looks like a secret, without its value.
pub(crate) fn refuse_secrets(fields: &Map<String, Value>) -> Result<()> {
    fields.iter().try_for_each(|(name, value)| refuse_in_field(name, value))
}

fn refuse_in_field(name: &str, value: &Value) -> Result<()> {
    if is_secret_value(name) {
        return secret_error("the name of a field");
    }
    match value {
        Value::String(text) if is_secret(name, text) => secret_error(name),
        Value::Array(items) => items.iter().try_for_each(|item| refuse_in_field(name, item)),
        Value::Object(fields) if is_key_object(fields) => secret_error(name),
        Value::Object(fields) => refuse_secrets(fields),
        _ => Ok(()),
    }
}

fn secret_error(name: &str) -> Result<()> {
    let problem = format_args!(
        "{name} looks like a secret, which is not shown here and must not be in a body, because bodies are written to files: \
             put it into a variable, and name that with --header-env or --api-key-env"
    );
    Err(Error::usage("--extra-body", problem))
}

/// True if the text of a field looks like a secret: it has the form of a key, a private key or a service account, or
/// the field name always means a secret, or the field name looks secret and the text is a long mixture of letters and
/// digits.
fn is_secret(name: &str, text: &str) -> bool {
    let letters: String = name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
    let has_secret_suffix = SECRET_SUFFIXES.iter().any(|suffix| letters.ends_with(suffix));
    let is_long_key = text.len() >= MIN_LENGTH
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_.+/=:~".contains(c))
        && text.contains(|c: char| c.is_ascii_digit());
    is_secret_value(text) || (has_secret_suffix && !text.is_empty()) || (is_secret_name(name) && is_long_key)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn invalid_keys_are_refused_and_not_shown() {
        let key = Secret::new(" sk-abc\n", "KEY").unwrap();
        assert_eq!(key.expose(), "sk-abc");
        assert!(!format!("{key:?}").contains("abc"));
        for wrong in ["", " \n", "sk-a b", "sk-\u{7f}", "sk-é", "sk\nab"] {
            let error = Secret::new(wrong, "KEY").unwrap_err().to_string();
            assert!(error.starts_with("KEY: "), "{error}");
            assert!(!error.contains("sk-"), "{error}");
        }
    }

    #[test]
    fn keys_in_shell_syntax_are_refused() {
        for wrong in ["\"sk-abc\"", "'sk-abc'", "OPENAI_API_KEY=sk-abc"] {
            let error = Secret::new(wrong, "KEY").unwrap_err().to_string();
            assert!(error.contains("leave only the key itself"), "{error}");
            assert!(!error.contains("sk-"), "{error}");
        }
        for right in ["c2VjcmV0LWtleQ==", "AB_C==", "a=b", "\"", "it's"] {
            assert_eq!(Secret::new(right, "KEY").unwrap().expose(), right);
        }
    }

    #[test]
    fn a_key_in_place_of_its_file_is_not_shown() {
        for key in ["sk-proj-0123", "0123456789abcdef0123456789abcdef"] {
            let error = Secret::read(Path::new(key)).unwrap_err().to_string();
            assert!(error.contains("the name of a file expected"), "{error}");
            assert!(!error.contains(key), "{error}");
        }
        for file in ["nowhere", "nowhere/key-of-the-vision-team-2026.txt"] {
            let error = Secret::read(Path::new(file)).unwrap_err().to_string();
            assert!(error.contains(file), "{error}");
        }
    }

    fn read_text(path: &std::path::Path, text: &[u8]) -> Result<Secret, String> {
        std::fs::write(path, text).unwrap();
        Secret::read(path).map_err(|e| e.to_string())
    }

    #[test]
    fn files_without_a_key_are_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        for right in [&b"sk-abc\n"[..], b"\xef\xbb\xbfsk-abc\r\n"] {
            assert_eq!(read_text(file.path(), right).unwrap().expose(), "sk-abc");
        }
        for wrong in [
            &b"sk-abc\nsk-def\n"[..],
            b"-----BEGIN OPENSSH PRIVATE KEY-----\nabc\n",
            b"-----BEGIN-abc",
            &[b'a'; 4097],
            b"sk-\xff",
        ] {
            let error = read_text(file.path(), wrong).unwrap_err();
            assert!(error.contains(&*file.path().to_string_lossy()), "{error}");
            assert!(!["sk-", "abc", "aaa"].iter().any(|part| error.contains(part)), "{error}");
        }
    }

    #[test]
    fn only_keys_are_removed_from_replies() {
        let scrub = Scrub::new(["kitchen".to_owned(), "sk-0123456789abcdef".to_owned()]);
        let reply = "A  kitchen\nsk-0123456789abcdef".to_owned();
        assert_eq!(scrub.reply(reply), "A  kitchen\n[secret]");
    }

    #[test]
    fn secrets_are_removed_before_shortening() {
        let scrub = Scrub::new(["sk-abcdef".to_owned(), "sk-abcdef-long".to_owned()]);
        assert_eq!(scrub.line("key \u{1b}[31msk-abc\u{200b}def-long,\r\n\tsk-abcdef"), "key [31m[secret], [secret]");
        let long = format!("{}sk-abcdef", "x".repeat(MAX_LINE - 4));
        assert!(!scrub.line(&long).contains("sk-"));
        assert_eq!(scrub.line(&"é".repeat(400)).chars().count(), MAX_LINE + 1);
        assert_eq!(Scrub::new(["x".to_owned()]).line("an axe\u{202e}"), "an axe");
    }

    const KEY: &str = "sk-proj-Ab12Cd34Ef56Gh78Ij90";

    fn masked(text: &str) -> String {
        SecretParts::new([KEY].into_iter()).masked(text.to_owned())
    }

    #[test]
    fn keys_in_base64_are_masked_at_any_offset() {
        for before in ["", "a", "ab", "Bearer ", "user:"] {
            for after in ["", "x", "xy"] {
                let encoded = STANDARD_NO_PAD.encode(format!("{before}{KEY}{after}"));
                let text = masked(&format!("It is {encoded}, ok"));
                let [head, tail] = text.split(MASK).collect::<Vec<_>>()[..] else {
                    panic!("{text}");
                };
                let left = head.len() + tail.len() - "It is , ok".len();
                // The rest encodes the surrounding text and at most two bytes of the key.
                let around = (before.len() + after.len()) * 4 / 3;
                assert!(left <= around + 5, "{encoded}: {text}");
            }
        }
    }

    #[test]
    fn keys_in_parts_are_masked() {
        for (text, expected) in [
            ("sk-proj-Ab12Cd34 and Ef56Gh78Ij90", "[secret] and [secret]"),
            ("s k - p r o j - A b 1 2 C d 3 4", "[secret]"),
            ("sk-proj-Ab12\nCd34Ef56\nGh78Ij90.", "[secret]."),
            ("AB12CD34EF56", "[secret]"),
            ("é Ab12\u{200b}Cd34Ef\\u0035\\u0036Gh7%38 é", "é [secret] é"),
        ] {
            assert_eq!(masked(text), expected);
        }
    }

    #[test]
    fn other_text_is_unchanged() {
        for text in ["sk-proj", "the project Ab12", "Zm9v12345678", "%zz \\ud83d %", "é\\"] {
            assert_eq!(masked(text), text);
        }
        let words = SecretParts::new(["bathroom-gateway-key-4711"].into_iter());
        assert_eq!(words.masked("bathroom".to_owned()), "bathroom");
        assert_eq!(words.masked("gateway-key-4711".to_owned()), MASK);
    }

    #[test]
    fn long_texts_lose_their_middle() {
        let kept = "é".repeat(MAX_TEXT / 2);
        assert_eq!(shortened(kept.clone()), kept);
        let long = shortened(format!("start é{} the end", "é".repeat(MAX_TEXT)));
        assert!(long.len() <= MAX_TEXT, "{}", long.len());
        assert!(long.starts_with("start é") && long.ends_with("é the end"));
        assert!(long.contains("bytes omitted …]"));
        assert_eq!(shortened(long.clone()), long);
    }

    #[test]
    fn names_are_short_and_without_keys() {
        let key = "sk-0123456789abcdef";
        let long = "x".repeat(MAX_NAME - 4) + key;
        let reply = Reply {
            served_model: Some(long.clone()),
            provider: Some(long),
            ..Reply::local(format!("{}{key}", "x".repeat(MAX_TEXT)))
        };
        let reply = without_secrets(reply, &Scrub::new([key.to_owned()]));
        let names = [reply.served_model, reply.provider].map(Option::unwrap);
        for text in names.iter().chain([&reply.text]) {
            assert!(!text.contains("sk-"), "{text}");
        }
        assert_eq!(names[0].len(), MAX_NAME);
    }

    fn refusal(body: &Value) -> Result<(), String> {
        refuse_secrets(body.as_object().unwrap()).map_err(|error| error.to_string())
    }

    #[test]
    fn secret_fields_are_refused() {
        for (fields, name) in [
            (json!({"api_key": "sk-0123456789"}), "api_key"),
            (json!({"user": "sk-0123456789"}), "user"),
            (json!({"a": {"b": [{"X-Api-Key": "0123"}]}}), "X-Api-Key"),
            (json!({"a": ["Bearer 0123"]}), "a"),
            (json!({"router": {"token": "0123456789abcdef0123"}}), "token"),
            (json!({"sk-0123456789": 1}), "the name of a field"),
            (json!({"note": "-----BEGIN PRIVATE KEY-----\n0123\n-----END PRIVATE KEY-----"}), "note"),
            (json!({"vertex_credentials": {"type": "service_account", "project_id": "0123"}}), "vertex_credentials"),
            (json!({"a": "{\"type\": \"service_account\", \"b\": \"0123\"}"}), "a"),
            (json!({"jwk": {"kty": "OKP", "d": "0123"}}), "jwk"),
        ] {
            let error = refusal(&fields).unwrap_err();
            let expected = format!("--extra-body: {name} looks like a secret");
            assert!(error.starts_with(&expected), "{error}");
            assert!(error.contains("--header-env") && !error.contains("0123"), "{error}");
        }
        for fields in [
            json!({"prompt_cache_key": "0f8fad5b-d9cb-469f-a165-70867728950e"}),
            json!({"tokenizer": "mistralai/Mistral-7B-Instruct-v0.3"}),
            json!({"eos_token": "<|end_of_text_number_2|>", "token_limit": 10, "api_key": null}),
            json!({"tools": [{"type": "function"}], "certificate": "-----BEGIN CERTIFICATE-----"}),
            json!({"keywords": ["the colour of 20 lamps in the room"]}),
        ] {
            assert!(refusal(&fields).is_ok(), "{fields}");
        }
    }
}
