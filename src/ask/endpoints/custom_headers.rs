//! Headers that the user adds to every request: [`CustomHeaders`].

use reqwest::header::{HeaderMap, HeaderName, HeaderValue};

use super::variable::variable;
use crate::ask::secrets::{is_secret_header, looks_like_key};
use crate::error::{Error, Result};

/// Headers that the user cannot set, because the program or its HTTP library sets them.
const RESERVED: [&str; 9] = [
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

/// Headers that the user adds to every request to an endpoint. Secret values come from environment variables.
#[derive(Clone, Default)]
pub struct CustomHeaders {
    map: HeaderMap,
    /// Values from environment variables, both whole and without a leading word such as `Bearer`.
    secrets: Vec<String>,
}

impl std::fmt::Debug for CustomHeaders {
    /// Lists the header names without their values.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.map.keys()).finish()
    }
}

impl CustomHeaders {
    /// Parses `--header 'NAME: VALUE'` and `--header-env NAME=VARIABLE`.
    ///
    /// # Errors
    /// If a header cannot be sent, is named twice, has a secret in place of a variable, or names a variable that is not
    /// set. No error shows a value.
    pub(super) fn read(plain: &[String], from_variables: &[String]) -> Result<Self> {
        let mut headers = Self::default();
        for text in plain {
            headers.add_plain(text)?;
        }
        for text in from_variables {
            headers.add_from_variable(text)?;
        }
        Ok(headers)
    }

    /// Adds a header given as `NAME: VALUE`.
    fn add_plain(&mut self, text: &str) -> Result<()> {
        let (name, value) = text
            .split_once(':')
            .ok_or_else(|| Error::usage("--header", "'NAME: VALUE' expected, as 'X-Team: vision'"))?;
        let (name, value) = (name.trim(), value.trim());
        if is_secret_header(name, value) {
            return Err(Error::usage(
                "--header",
                format_args!(
                    "the value of {name} looks like a secret, which is not shown here; put it into a variable and name that: \
                 --header-env {name}=VARIABLE"
                ),
            ));
        }
        self.add(name, value, "--header")
    }

    /// Adds a header given as `NAME=VARIABLE`.
    fn add_from_variable(&mut self, text: &str) -> Result<()> {
        let (name, variable_name) = text
            .split_once('=')
            .ok_or_else(|| Error::usage("--header-env", "NAME=VARIABLE expected, as X-Auth=GATEWAY_TOKEN"))?;
        let (name, variable_name) = (name.trim(), variable_name.trim());
        if looks_like_key(variable_name) {
            return Err(Error::usage(
                "--header-env",
                format_args!(
                    "the value after {name}= looks like a secret, which is not shown here; put it into a variable and name that"
                ),
            ));
        }
        let value = variable(variable_name)
            .ok_or_else(|| Error::usage("--header-env", format_args!("the variable {variable_name} is not set")))?;
        let value = value.trim();
        self.add(name, value, "--header-env")?;
        self.secrets.push(value.to_owned());
        // A server may repeat the secret without its leading word: only the token of "Bearer …".
        if let Some((_, secret)) = value.split_once(' ') {
            self.secrets.push(secret.to_owned());
        }
        Ok(())
    }

    /// Adds a header. Errors name `flag`, the flag that the header comes from.
    fn add(&mut self, name: &str, value: &str, flag: &str) -> Result<()> {
        let Ok(header_name) = HeaderName::try_from(name) else {
            return Err(Error::usage(flag, "this is not a valid name of an HTTP header"));
        };
        if RESERVED.contains(&header_name.as_str()) {
            return Err(Error::usage(flag, format_args!("{name} is set by the program itself")));
        }
        let Ok(mut header_value) = HeaderValue::try_from(value) else {
            return Err(Error::usage(
                flag,
                format_args!("the value of {name} has characters that an HTTP header cannot carry"),
            ));
        };
        header_value.set_sensitive(flag == "--header-env");
        if self.map.insert(header_name, header_value).is_some() {
            return Err(Error::usage(flag, format_args!("{name} is named twice")));
        }
        Ok(())
    }

    /// Secret values to remove from everything that is stored.
    pub(super) fn secrets(&self) -> &[String] {
        &self.secrets
    }

    /// Adds these headers to the headers of a request.
    ///
    /// # Errors
    /// If the request already has a header of the same name, for the key or the account.
    pub(super) fn add_to(&self, headers: &mut HeaderMap) -> Result<()> {
        for (name, value) in &self.map {
            if headers.insert(name, value.clone()).is_some() {
                let problem = format_args!(
                    "{name} is sent already, with the key or the account: leave it out of --header and --header-env, or the key with --api-key-env none"
                );
                return Err(Error::usage("--header", problem));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(plain: &[&str]) -> Result<CustomHeaders> {
        let plain: Vec<String> = plain.iter().map(|text| (*text).to_owned()).collect();
        CustomHeaders::read(&plain, &[])
    }

    #[test]
    fn headers_are_checked() {
        let headers = read(&["X-Team: a: b", "x-empty:"]).unwrap();
        assert_eq!(headers.map["x-team"], "a: b");
        assert_eq!(headers.map["x-empty"], "");
        for (wrong, part) in [
            (&["X-Team"][..], "'NAME: VALUE'"),
            (&["Content-Type: a/b"], "the program itself"),
            (&["a b: c"], "not a valid name"),
            (&["X-A: b", "x-a: c"], "twice"),
            (&["X-A: b\u{7f}"], "cannot carry"),
        ] {
            let error = read(wrong).unwrap_err().to_string();
            assert!(error.starts_with("--header: ") && error.contains(part), "{error}");
        }
    }

    #[test]
    fn secrets_on_the_command_line_are_refused() {
        for secret in [
            "X-Any: sk-0123456789",
            "Authorization: Bearer abcdefghijklmnop",
            "X-Auth-Token: 0123456789abcdef0123",
            "Cookie: session=0123456789abcdef",
        ] {
            let error = read(&[secret]).unwrap_err().to_string();
            assert!(error.contains("--header-env"), "{error}");
            assert!(!error.contains("0123") && !error.contains("abcd"), "{error}");
        }
        assert!(read(&["X-Team: 0123456789abcdef0123"]).is_ok());
        let secret_as_variable = ["X-Auth=sk-0123456789".to_owned()];
        let error = CustomHeaders::read(&[], &secret_as_variable).unwrap_err().to_string();
        assert!(!error.contains("0123"), "{error}");
    }

    #[test]
    fn a_header_is_not_sent_twice() {
        let headers = read(&["X-Team: a"]).unwrap();
        let mut request = HeaderMap::new();
        headers.add_to(&mut request).unwrap();
        assert_eq!(request["x-team"], "a");
        assert!(headers.add_to(&mut request).is_err());
    }
}
