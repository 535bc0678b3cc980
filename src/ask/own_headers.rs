//! Headers that the user adds to every request: [`OwnHeaders`].

use reqwest::header::{HeaderMap, HeaderName, HeaderValue};

use super::key_form::{is_secret_name, is_secret_value};
use super::variable::variable;
use crate::error::{Error, Result};

/// Headers that the program or its HTTP library sets, so that they cannot be set by the user.
const OWNED: [&str; 9] = [
    "accept-encoding",
    "connection",
    "content-encoding",
    "content-length",
    "content-type",
    "expect",
    "host",
    "te",
    "transfer-encoding",
];

/// Headers that the user adds to every request of an endpoint. The values of secret ones come from variables.
#[derive(Clone, Default)]
pub struct OwnHeaders {
    map: HeaderMap,
    secrets: Vec<String>,
}

impl std::fmt::Debug for OwnHeaders {
    /// The names alone.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.map.keys()).finish()
    }
}

impl OwnHeaders {
    /// The headers of `--header 'NAME: VALUE'` and `--header-env NAME=VARIABLE`.
    ///
    /// # Errors
    /// If one cannot be sent, is named twice, or holds a secret that no variable holds. No error shows a value.
    pub(super) fn read(plain: &[String], from_variables: &[String]) -> Result<Self> {
        let mut own = Self::default();
        for text in plain {
            let wrong = |problem: String| Error::usage("--header", problem);
            let (name, value) = text
                .split_once(':')
                .ok_or_else(|| wrong("'NAME: VALUE' expected, as 'X-Team: vision'".to_owned()))?;
            let (name, value) = (name.trim(), value.trim());
            if is_secret_value(value) || (is_secret_name(name) && value.len() >= 20) {
                return Err(wrong(format!(
                    "the value of {name} looks like a secret, which is not shown here; put it into a variable and name that: \
                     --header-env {name}=VARIABLE"
                )));
            }
            own.add(name, value, "--header")?;
        }
        for text in from_variables {
            let wrong = |problem: String| Error::usage("--header-env", problem);
            let (name, variable_name) = text.split_once('=').ok_or_else(|| {
                wrong("NAME=VARIABLE expected, as X-Auth=GATEWAY_TOKEN".to_owned())
            })?;
            let (name, variable_name) = (name.trim(), variable_name.trim());
            if super::key_form::looks_like_key(variable_name) {
                return Err(wrong(format!(
                    "the value after {name}= looks like a secret, which is not shown here; put it into a variable and name that"
                )));
            }
            let value = variable(variable_name)
                .ok_or_else(|| wrong(format!("the variable {variable_name} is not set")))?;
            let value = value.trim();
            own.add(name, value, "--header-env")?;
            own.secrets.push(value.to_owned());
            // A server may repeat the secret without the word before it, as in "Bearer …".
            if let Some((_, secret)) = value.split_once(' ') {
                own.secrets.push(secret.to_owned());
            }
        }
        Ok(own)
    }

    fn add(&mut self, name: &str, value: &str, flag: &str) -> Result<()> {
        let wrong = |problem: String| Err(Error::usage(flag, problem));
        let Ok(header) = HeaderName::try_from(name) else {
            return wrong("this is not a valid name of an HTTP header".to_owned());
        };
        if OWNED.contains(&header.as_str()) {
            return wrong(format!("{name} is set by the program itself"));
        }
        let Ok(mut text) = HeaderValue::try_from(value) else {
            return wrong(format!(
                "the value of {name} has characters that an HTTP header cannot carry"
            ));
        };
        text.set_sensitive(flag == "--header-env");
        if self.map.insert(header, text).is_some() {
            return wrong(format!("{name} is named twice"));
        }
        Ok(())
    }

    /// The values that must be removed from all that is kept.
    pub(super) fn secrets(&self) -> &[String] {
        &self.secrets
    }

    /// Adds the headers to those of a request.
    ///
    /// # Errors
    /// If one carries the key of the request already.
    pub(super) fn extend(&self, headers: &mut HeaderMap) -> Result<()> {
        for (name, value) in &self.map {
            if headers.insert(name, value.clone()).is_some() {
                let problem = format_args!(
                    "{name} is sent already, with the key or the account; --api-key-env none leaves the key out"
                );
                return Err(Error::usage("--header-env", problem));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(plain: &[&str]) -> Result<OwnHeaders> {
        let plain: Vec<String> = plain.iter().map(|text| (*text).to_owned()).collect();
        OwnHeaders::read(&plain, &[])
    }

    #[test]
    fn headers_are_checked() {
        let own = read(&["X-Team: a: b", "x-empty:"]).unwrap();
        assert_eq!(own.map["x-team"], "a: b");
        assert_eq!(own.map["x-empty"], "");
        for (wrong, part) in [
            (&["X-Team"][..], "'NAME: VALUE'"),
            (&["Content-Type: a/b"], "the program itself"),
            (&["a b: c"], "not a valid name"),
            (&["X-A: b", "x-a: c"], "twice"),
            (&["X-A: b\u{7f}"], "cannot carry"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("--header: ") && error.contains(part),
                "{error}"
            );
        }
    }

    #[test]
    fn a_secret_on_the_command_line_is_refused_and_not_shown() {
        for secret in [
            "X-Any: sk-0123456789",
            "Authorization: Bearer abcdefghijklmnop",
            "X-Auth-Token: 0123456789abcdef0123",
            "Cookie: session=0123456789abcdef",
        ] {
            let error = read(&[secret]).unwrap_err().to_string();
            assert!(error.contains("--header-env"), "{error}");
            assert!(
                !error.contains("0123") && !error.contains("abcd"),
                "{error}"
            );
        }
        assert!(read(&["X-Team: 0123456789abcdef0123"]).is_ok());
        let behind = ["X-Auth=sk-0123456789".to_owned()];
        let error = OwnHeaders::read(&[], &behind).unwrap_err().to_string();
        assert!(!error.contains("0123"), "{error}");
    }

    #[test]
    fn a_key_is_not_sent_twice() {
        let own = read(&["X-Team: a"]).unwrap();
        let mut headers = HeaderMap::new();
        own.extend(&mut headers).unwrap();
        assert_eq!(headers["x-team"], "a");
        assert!(own.extend(&mut headers).is_err());
    }
}
