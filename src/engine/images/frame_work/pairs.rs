//! Conditions of pairs of a frame and its photograph in the dark: the photograph itself, or a degradation that is as
//! dark ([`Resolved`]).

use std::sync::Arc;

use super::FrameWork;
use crate::engine::images::frames::matching_degradation;
use crate::engine::images::timings::TimedStep;
use crate::error::{Error, Result};
use crate::pictures::Payload;
use crate::types::{Condition, FrameId, PairDark, PairFacts, PhotoName, Treatment};

/// A condition of one frame after pairs are replaced: a photograph becomes an untouched frame, and a synthetic image as
/// dark as the photograph becomes a degradation with the exposure drop of that photograph. So all rules for untouched
/// and degraded frames apply.
pub(crate) struct Resolved<'w, 'a> {
    /// The steps of the frame, or of its photograph.
    pub(crate) work: &'w mut FrameWork<'a>,
    /// The condition of `work`: untouched or degraded.
    pub(crate) condition: Condition,
    /// How dark the photograph is; `None` if the condition has no pair.
    pub(crate) pair: Option<PairFacts>,
}

impl<'a> FrameWork<'a> {
    /// Replaces the pair in a condition of this frame.
    ///
    /// # Errors
    /// If the frame has no such photograph, or its exposure drop is unknown or cannot be synthesised.
    pub(crate) fn resolve(&mut self, condition: &Condition) -> Result<Resolved<'_, 'a>> {
        match &condition.treatment {
            Treatment::Untouched | Treatment::Degraded(_) => {
                Ok(Resolved { work: self, condition: condition.clone(), pair: None })
            }
            Treatment::Paired(PairDark::Match(kind, reading)) => {
                let (how, facts) =
                    matching_degradation(&self.photographs, *kind, reading.as_ref()).ok_or_else(|| {
                        let problem = "no photograph in the dark with a known exposure drop";
                        Error::data(&self.frame, problem)
                    })?;
                Ok(Resolved {
                    work: self,
                    condition: with_treatment(condition, Treatment::Degraded(how)),
                    pair: Some(facts),
                })
            }
            Treatment::Paired(PairDark::Photograph(name)) => {
                let pair = Some(self.pair_facts(name)?);
                Ok(Resolved {
                    work: self.photograph_work(name)?,
                    condition: with_treatment(condition, Treatment::Untouched),
                    pair,
                })
            }
        }
    }

    /// How dark a photograph is; measured on first use.
    fn pair_facts(&mut self, name: &PhotoName) -> Result<PairFacts> {
        let index = self.photograph_index(name)?;
        if let Some(facts) = self.photographs[index].facts {
            return Ok(facts);
        }
        let normal = Arc::clone(self.clean()?);
        let low = Arc::clone(self.photograph_work(name)?.clean()?);
        let photo = &mut self.photographs[index];
        let facts = self.steps.timings.time(TimedStep::Measure, || photo.measure(&normal, &low));
        photo.facts = Some(facts);
        Ok(facts)
    }

    /// The steps of a photograph of the frame. Their noise key is never used, because a photograph is not degraded.
    fn photograph_work(&mut self, name: &PhotoName) -> Result<&mut Self> {
        let planned = self.photographs[self.photograph_index(name)?].digest;
        let (steps, of, key) = (self.steps, &self.frame, self.key);
        Ok(self.photograph_works.entry(name.clone()).or_insert_with(|| {
            let label = FrameId(format!("{of} ({name})"));
            Box::new(Self {
                photograph: Some((of.clone(), name.clone())),
                ..Self::new(steps, label, key, Some(planned))
            })
        }))
    }

    fn photograph_index(&self, name: &PhotoName) -> Result<usize> {
        self.photographs
            .iter()
            .position(|photo| photo.name == *name)
            .ok_or_else(|| Error::data(&self.frame, format_args!("no photograph {name} of this frame")))
    }
}

/// The same condition with another treatment.
fn with_treatment(condition: &Condition, treatment: Treatment) -> Condition {
    Condition { treatment, ..condition.clone() }
}

/// Adds the facts about a pair to an image of it.
pub(crate) fn with_pair_facts(payload: Arc<Payload>, pair: Option<PairFacts>) -> Arc<Payload> {
    match pair {
        None => payload,
        pair => Arc::new(Arc::unwrap_or_clone(payload).with_pair(pair)),
    }
}
