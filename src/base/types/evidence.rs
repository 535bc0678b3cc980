//! The facts from which the answer to a question was derived: [`Evidence`].

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;
use serde_json::value::{RawValue, to_raw_value};

/// The key of the name of a question that is asked about every image.
pub const BANK_ID: &str = "bank_id";

/// A value of JSON that is kept as its text, and shared by all copies of a question. Evidence may be ten times as large
/// as the rest of a question, and ten times larger again as a tree; few readers need it.
#[derive(Clone, Default)]
pub struct Evidence(Option<Arc<RawValue>>);

impl Evidence {
    /// True if the data set states none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.0.is_none()
    }

    /// The value; `Null` if the data set states none.
    #[must_use]
    pub fn value(&self) -> Value {
        self.text().and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
    }

    /// The name of a question that is asked about every image; `None` for other questions.
    #[must_use]
    pub fn bank_id(&self) -> Option<Cow<'_, str>> {
        #[derive(Deserialize)]
        struct Named<'a> {
            #[serde(borrow)]
            bank_id: Cow<'a, str>,
        }
        serde_json::from_str::<Named<'_>>(self.text()?).ok().map(|named| named.bank_id)
    }

    fn text(&self) -> Option<&str> {
        self.0.as_deref().map(RawValue::get)
    }
}

/// `Null` is no evidence. A value from the text of JSON can always be written as such.
impl From<Value> for Evidence {
    fn from(value: Value) -> Self {
        let text = if value.is_null() { None } else { to_raw_value(&value).ok() };
        Self(text.map(Arc::from))
    }
}

/// Texts are compared. Evidence that this program wrote has one text for one value.
impl PartialEq for Evidence {
    fn eq(&self, other: &Self) -> bool {
        self.text() == other.text()
    }
}

impl Eq for Evidence {}

impl fmt::Debug for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text().unwrap_or("null"))
    }
}

impl Serialize for Evidence {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.as_deref().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Evidence {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = Option::<Box<RawValue>>::deserialize(deserializer)?;
        Ok(Self(text.map(Arc::from)))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn evidence_is_written_as_it_was_read() {
        for text in [r#"{"about":"lamp","z":[1,2.50]}"#, "null", "\"x\"", "3"] {
            let read: Evidence = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&read).unwrap(), text);
            assert_eq!(read.is_none(), text == "null");
            assert_eq!(read.value(), serde_json::from_str::<Value>(text).unwrap());
        }
        let value = json!({"b": 1, "a": null});
        assert_eq!(serde_json::from_value::<Evidence>(value.clone()).unwrap(), Evidence::from(value.clone()));
        assert_eq!(Evidence::from(value.clone()).value(), value);
        assert_eq!(Evidence::from(Value::Null), Evidence::default());
    }

    #[test]
    fn only_questions_of_a_bank_have_its_name() {
        let name = |value: Value| Evidence::from(value).bank_id().map(Cow::into_owned);
        assert_eq!(name(json!({"bank_id": "lamp \"1\""})).as_deref(), Some("lamp \"1\""));
        for other in [json!({"about": "lamp"}), json!({"bank_id": 3}), json!("bank_id"), Value::Null] {
            assert_eq!(name(other), None);
        }
    }
}
