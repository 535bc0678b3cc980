//! What a cell of a table is about: [`Subject`].

use serde::Serialize;

use crate::types::{AxisLevel, Condition, EnhancerName, KindReading, Record, View};

/// The name under which guessing stands among the models.
pub(crate) const CHANCE: &str = "chance";

/// What a cell of a table is about.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Subject {
    /// The model, or [`CHANCE`].
    pub model: String,
    /// Whether it saw the images; `None` for chance.
    pub view: Option<View>,
    /// How far they were degraded; `None` where none was seen.
    pub level: Option<AxisLevel>,
    /// The kind of degradation, in its light reading.
    pub variant: KindReading,
    /// What mended them; `None` for raw.
    pub enhancer: Option<EnhancerName>,
}

impl Subject {
    /// Whom a record is of.
    #[must_use]
    pub fn of(record: &Record) -> Self {
        Self::shown(&record.model, record.condition.as_ref())
    }

    /// Whoever answers under a name, and what was shown; `None` where nothing was.
    #[must_use]
    pub fn shown(model: &str, condition: Option<&Condition>) -> Self {
        Self {
            model: model.to_owned(),
            view: Some(condition.map_or(View::Blind, |_| View::Image)),
            level: condition.map(Condition::level),
            variant: condition.map_or(KindReading::NONE, Condition::kind_reading),
            enhancer: condition.and_then(|condition| condition.enhancer.clone()),
        }
    }

    /// What it is shown, as `L3-noise+zerodce`, or `blind`.
    #[must_use]
    pub fn condition(&self) -> String {
        let Some(level) = self.level else {
            return "blind".to_owned();
        };
        let variant = match self.variant.kind {
            None => String::new(),
            Some(_) => format!("-{}", self.variant),
        };
        let enhancer = self.enhancer.as_ref().map(|name| format!("+{name}"));
        format!("{level}{variant}{}", enhancer.unwrap_or_default())
    }

    /// A model that sees, at a level of a variant, raw or enhanced; L0 is the untouched frame of every variant and enhancer.
    #[must_use]
    pub fn seeing(
        model: &str,
        level: AxisLevel,
        variant: &KindReading,
        enhancer: Option<&EnhancerName>,
    ) -> Self {
        let light = level == AxisLevel::L0;
        Self {
            model: model.to_owned(),
            view: Some(View::Image),
            level: Some(level),
            variant: if light {
                KindReading::NONE
            } else {
                variant.clone()
            },
            enhancer: enhancer.filter(|_| !light).cloned(),
        }
    }
}
