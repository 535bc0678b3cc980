//! Work in the darkness of a pair: on the photograph of the frame, or with the exposure drop that it has ([`Resolved`]).

use std::sync::Arc;

use super::FrameWork;
use crate::error::{Error, Result};
use crate::images::frames::matched;
use crate::images::timings::TimedStep;
use crate::picture::Payload;
use crate::types::{Condition, FrameId, PairDark, PairFacts, PhotoName, Treatment};

/// A condition of one frame, without the darkness of a pair: its photograph is an untouched frame of its own, and a synthetic image as
/// dark as that has the exposure drop of this frame. So every rule for untouched and degraded frames holds for pairs too.
pub(crate) struct Resolved<'w, 'a> {
    /// The work on the frame, or on its photograph.
    pub(crate) work: &'w mut FrameWork<'a>,
    /// The condition of that work: untouched or degraded.
    pub(crate) condition: Condition,
    /// How dark the photograph is; `None` for conditions that are the same for all frames.
    pub(crate) pair: Option<PairFacts>,
}

impl<'a> FrameWork<'a> {
    /// A condition of this frame without the darkness of a pair.
    ///
    /// # Errors
    /// If the frame has no such photograph, or one whose darkness cannot be synthesised.
    pub(crate) fn resolved(&mut self, condition: &Condition) -> Result<Resolved<'_, 'a>> {
        let resolved = |treatment: Treatment| Condition {
            treatment,
            ..condition.clone()
        };
        match &condition.treatment {
            Treatment::Untouched | Treatment::Degraded(_) => Ok(Resolved {
                work: self,
                condition: condition.clone(),
                pair: None,
            }),
            Treatment::Paired(PairDark::Match(kind, reading)) => {
                let (how, facts) =
                    matched(&self.photographs, *kind, reading.as_ref()).ok_or_else(|| {
                        let problem = "no photograph in the dark with a known exposure drop";
                        Error::data(&self.frame, problem)
                    })?;
                Ok(Resolved {
                    work: self,
                    condition: resolved(Treatment::Degraded(how)),
                    pair: Some(facts),
                })
            }
            Treatment::Paired(PairDark::Photograph(name)) => {
                let pair = Some(self.pair_facts(name)?);
                Ok(Resolved {
                    work: self.dark(name)?,
                    condition: resolved(Treatment::Untouched),
                    pair,
                })
            }
        }
    }

    /// How dark a photograph is. It is measured once.
    fn pair_facts(&mut self, name: &PhotoName) -> Result<PairFacts> {
        let place = self.place(name)?;
        if let Some(facts) = self.photographs[place].facts {
            return Ok(facts);
        }
        let normal = Arc::clone(self.clean()?);
        let low = Arc::clone(self.dark(name)?.clean()?);
        let photo = &mut self.photographs[place];
        let measure = || photo.measured(&normal, &low);
        let facts = self.steps.timings.time(TimedStep::Measure, measure);
        photo.facts = Some(facts);
        Ok(facts)
    }

    /// Work on a photograph of the frame. Its noise key is never used, because nothing is synthesised on it.
    fn dark(&mut self, name: &PhotoName) -> Result<&mut Self> {
        let planned = self.photographs[self.place(name)?].digest;
        let (steps, of, key) = (self.steps, &self.frame, self.key);
        let work = self.dark.entry(name.clone()).or_insert_with(|| {
            let label = FrameId(format!("{of} ({name})"));
            Box::new(Self {
                photograph: Some((of.clone(), name.clone())),
                ..Self::new(steps, label, key, Some(planned))
            })
        });
        Ok(work)
    }

    fn place(&self, name: &PhotoName) -> Result<usize> {
        let place = self
            .photographs
            .iter()
            .position(|photo| photo.name == *name);
        place.ok_or_else(|| {
            Error::data(
                &self.frame,
                format_args!("no photograph {name} of this frame"),
            )
        })
    }
}

/// An image with the darkness of the photograph of its frame, if it is in that darkness.
pub(crate) fn paired(payload: Arc<Payload>, pair: Option<PairFacts>) -> Arc<Payload> {
    match pair {
        None => payload,
        pair => Arc::new(Arc::unwrap_or_clone(payload).paired_by(pair)),
    }
}
