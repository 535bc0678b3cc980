//! The looks of two sets of frames side by side: [`LookComparison`], by their quartiles.

use serde::Serialize;

use crate::text::table::ColumnKind::Text;
use crate::text::table::TableBuilder;
use crate::text::terminal;
use darkqa_questions::appearance::{FrameAppearance, MIN_EDGE_GRADIENT};
use darkqa_questions::colors::{Color, NONE};

/// Two sets of frames, compared by how they look.
#[derive(Debug, Serialize)]
pub(crate) struct LookComparison {
    /// The names of both sets, and their numbers of frames.
    sets: [(String, usize); 2],
    rows: Vec<LookRow>,
}

/// One measure of both sets.
#[derive(Debug, Serialize)]
struct LookRow {
    measure: String,
    /// The quartiles of the first and of the other set: 25 %, 50 % and 75 % of the frames that have the measure; `None` if none has.
    quartiles: [Option<[f64; 3]>; 2],
    /// How many decimals are shown.
    #[serde(skip)]
    decimals: usize,
}

impl LookRow {
    fn new(
        sets: [&[FrameAppearance]; 2],
        measure: &str,
        decimals: usize,
        of: impl Fn(&FrameAppearance) -> Option<f64>,
    ) -> Self {
        Self {
            measure: measure.to_owned(),
            quartiles: sets.map(|looks| quartiles(looks.iter().filter_map(&of).collect())),
            decimals,
        }
    }

    fn text(&self, set: usize) -> String {
        let shown = |value: f64| format!("{value:.*}", self.decimals);
        match self.quartiles[set] {
            Some([low, middle, high]) => {
                format!("{} ({} to {})", shown(middle), shown(low), shown(high))
            }
            None => "–".to_owned(),
        }
    }

    /// Whether the median of the first set lies within the quartiles of the other.
    fn verdict(&self) -> &'static str {
        match self.quartiles {
            [Some([_, middle, _]), Some([low, _, _])] if middle < low => "below",
            [Some([_, middle, _]), Some([_, _, high])] if middle > high => "above",
            [Some(_), Some(_)] => "within",
            _ => "–",
        }
    }
}

/// The nearest-rank quartiles of numbers; `None` of none.
fn quartiles(mut numbers: Vec<f64>) -> Option<[f64; 3]> {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len();
    (count > 0).then(|| [1, 2, 3].map(|quarter| numbers[(count * quarter).div_ceil(4) - 1]))
}

impl LookComparison {
    /// The comparison of two sets, each with its name.
    #[must_use]
    pub(crate) fn new(sets: [(&str, &[FrameAppearance]); 2]) -> Self {
        let looks = sets.map(|(_, looks)| looks);
        let mut rows = vec![
            LookRow::new(looks, "mean linear light, EV of white", 2, |look| {
                Some(look.light_ev)
            }),
            LookRow::new(looks, "pixels at edges, %", 1, |look| {
                Some(100.0 * look.edges)
            }),
            LookRow::new(looks, "segments", 0, |look| look.segments.map(|n| n as f64)),
            LookRow::new(looks, "depth, median, m", 2, |look| {
                look.depth.map(|[_, m, _]| m)
            }),
            LookRow::new(looks, "depth, 90 % less 10 %, m", 2, |look| {
                look.depth.map(|[near, _, far]| far - near)
            }),
        ];
        rows.extend(Color::ALL.iter().enumerate().map(|(place, color)| {
            let measure = format!("{} pixels, %", color.name());
            LookRow::new(looks, &measure, 1, |look| Some(100.0 * look.colors[place]))
        }));
        rows.push(LookRow::new(
            looks,
            "pixels of no colour's name, %",
            1,
            |look| Some(100.0 * look.colors[NONE]),
        ));
        Self {
            sets: sets.map(|(name, looks)| (name.to_owned(), looks.len())),
            rows,
        }
    }

    /// The table for the terminal.
    #[must_use]
    pub(crate) fn table(&self) -> String {
        let [first, other] = [0, 1].map(|set| {
            let (name, frames) = &self.sets[set];
            format!("terminal {name} ({frames})").replace(", ", " ")
        });
        let table = TableBuilder::new("against", &self.rows)
            .column(Text, "terminal by frame", |row| row.measure.clone())
            .column(Text, &*first, |row| row.text(0))
            .column(Text, &*other, |row| row.text(1))
            .column(Text, "terminal median is", |row| row.verdict())
            .build();
        format!(
            "{}medians (quartiles); edges: {MIN_EDGE_GRADIENT} codes of luma per pixel, images of 480 rows at most; colours of pixels are named by the table of the rules\n",
            terminal::table(&[table])
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(light_ev: f64, segments: Option<usize>) -> FrameAppearance {
        FrameAppearance {
            light_ev,
            edges: 0.25,
            colors: [0.0; 12],
            segments,
            depth: None,
        }
    }

    #[test]
    fn a_median_is_judged_by_the_quartiles_of_the_other_set() {
        let dark: Vec<FrameAppearance> = (1..=4).map(|ev| look(-f64::from(ev), Some(9))).collect();
        let bright = [look(-0.5, None)];
        let of = |first: &[FrameAppearance], other: &[FrameAppearance]| {
            let compared = LookComparison::new([("a", first), ("b", other)]);
            let verdicts = [0, 2, 3].map(|row: usize| compared.rows[row].verdict());
            (compared.rows[0].quartiles[0], verdicts)
        };
        // Nearest ranks: of four numbers the first, the second and the third.
        assert_eq!(of(&dark, &dark).0, Some([-4.0, -3.0, -2.0]));
        assert_eq!(of(&dark, &dark).1, ["within", "within", "–"]);
        assert_eq!(of(&dark, &bright).1, ["below", "–", "–"]);
        assert_eq!(of(&bright, &dark).1, ["above", "–", "–"]);
        assert!(quartiles(Vec::new()).is_none());
    }
}
