//! The data of a crossed design: [`Observation`].

use std::collections::BTreeMap;

/// One parsed reply of a crossed design, or the difference of two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Question; the same in all conditions.
    pub question: u32,
    /// Scene, or other independent unit, of the question. All observations of a question have the same.
    pub scene: u32,
    pub wording: u16,
    pub order: u16,
    pub draw: u16,
    pub repeat: u16,
    /// 1 if the reply is right and 0 if it is wrong; −1 to 1 for a difference.
    pub value: f64,
}

/// Facet of a crossed design: what a question is asked under. Its levels are a sample of the possible ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Facet {
    /// Wordings of the prompt.
    Wording,
    /// Orders of the choices.
    Order,
    /// Draws of the noise.
    Draw,
}

impl Facet {
    pub const ALL: [Self; 3] = [Self::Wording, Self::Order, Self::Draw];

    /// The name in tables and charts.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wording => "wording",
            Self::Order => "order",
            Self::Draw => "draw",
        }
    }
}

impl Observation {
    /// Level of a facet.
    #[must_use]
    pub fn level(&self, facet: Facet) -> u16 {
        match facet {
            Facet::Wording => self.wording,
            Facet::Order => self.order,
            Facet::Draw => self.draw,
        }
    }

    /// Levels of all facets.
    pub(super) fn combination(&self) -> [u16; 3] {
        Facet::ALL.map(|facet| self.level(facet))
    }

    fn key(&self) -> (u32, u32, [u16; 3], u16) {
        (self.scene, self.question, self.combination(), self.repeat)
    }
}

/// The observations in order of scene, question, facets and repeat, so that results do not depend on their order.
pub(super) fn sorted(observations: &[Observation]) -> Vec<Observation> {
    let mut sorted = observations.to_vec();
    sorted.sort_by(|a, b| a.key().cmp(&b.key()).then(a.value.total_cmp(&b.value)));
    sorted
}

/// The differences `first` − `second` of the observations with the same question, wording, order, draw and repeat.
/// Observations without a partner are left out; of several with the same key, the last counts.
#[must_use]
pub fn paired(first: &[Observation], second: &[Observation]) -> Vec<Observation> {
    let by_key = |side: &[Observation]| -> BTreeMap<_, _> {
        side.iter().map(|observation| (observation.key(), *observation)).collect()
    };
    let second = by_key(second);
    by_key(first)
        .into_iter()
        .filter_map(|(key, first)| Some(Observation { value: first.value - second.get(&key)?.value, ..first }))
        .collect()
}
