//! The texts of a run's replies: [`RunTexts`].

use std::path::Path;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::store::RecordLog;
use crate::types::{Detail, Record, TextPlace};

/// Where the texts of a run's replies are read.
#[derive(Debug, Clone)]
pub(crate) enum RunTexts<D> {
    /// In the file of the run.
    Stored(Arc<RecordLog>),
    /// In records that are held, by their numbers.
    Held(Arc<[Record<D>]>),
}

impl<D: Detail> RunTexts<D> {
    /// The texts in the folder of a run.
    ///
    /// # Errors
    /// If its file cannot be opened.
    pub(super) fn of(folder: &Path) -> Result<Self> {
        let log = RecordLog::open_if_there(folder)?;
        Ok(log.map_or_else(|| Self::Held([].into()), |log| Self::Stored(log.into())))
    }

    /// The record of a trial.
    ///
    /// # Errors
    /// If the file of the run cannot be read any more, or was changed.
    pub(crate) fn record(&self, place: TextPlace) -> Result<Record<D>> {
        match self {
            Self::Stored(log) => log.record(&log.line_from(place.start())?),
            Self::Held(records) => {
                let record = records.get(place.start() as usize);
                record.cloned().ok_or_else(|| {
                    Error::data(
                        "records",
                        format_args!("there is none at {}", place.start()),
                    )
                })
            }
        }
    }

    /// What stands in the place of a reply: its text; else that of a refusal, else what the error says.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    pub(crate) fn text(&self, place: TextPlace) -> Result<String> {
        let record = self.record(place)?;
        Ok(record.text_or_error().unwrap_or_default().to_owned())
    }
}
