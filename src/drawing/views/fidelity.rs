//! The figure of fidelity against answers: [`drawing`].

use std::collections::BTreeMap;

use crate::drawing::chart::drawn::Drawn;
use crate::drawing::chart::{Chart, LineStyle, Panel, PanelContent, PlotLine};
use crate::drawing::figures::Drawing;
use crate::text::words::light;
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::ConditionFidelity;

/// A light: a variant, raw or with an enhancer.
type Light<'f> = (&'f Variant, Option<&'f EnhancerName>);

/// A number of a condition as a share, with its interval where it has one.
type Quantity = fn(&ConditionFidelity) -> Option<Estimate>;

/// Style of the line of chance.
const CHANCE: LineStyle = LineStyle::REFERENCE;

/// The panels: title, number, and the share that chance has.
const PANELS: [(&str, Quantity, Option<f64>); 3] = [
    ("SSIM of the images", |row| known(row.means[1]?), None),
    ("share of right answers", |row| known(row.accuracy), None),
    (
        "AUC of PSNR",
        |row| Some(row.predicts[0]?.auc.estimate),
        Some(0.5),
    ),
];

/// Similarity of the images, accuracy, and how well similarity tells right from wrong answers, by level: a row of panels for each
/// axis, a line for each light.
/// `None` where no image was measured.
pub(super) fn drawing(findings: &Findings<'_>) -> Option<Drawing> {
    let fidelity = findings.fidelity.as_ref()?;
    let mut lights = BTreeMap::<Light<'_>, Vec<&ConditionFidelity>>::new();
    // A photograph in the dark lies at no level.
    let at_levels = fidelity.conditions.iter();
    for row in at_levels.filter(|row| row.level != AxisLevel::PAIR) {
        let light = (&row.variant, row.enhancer.as_ref());
        lights.entry(light).or_default().push(row);
    }
    let panels: Vec<Panel> = Axis::ALL
        .into_iter()
        .flat_map(|axis| PANELS.map(|panel| self::panel(&lights, axis, panel)))
        .filter(|panel| panel.lines.iter().any(is_curve))
        .collect();
    if panels.is_empty() {
        return None;
    }
    let models = match fidelity.models.len() {
        1 => format!("answers of {}", fidelity.models[0]),
        several => format!("answers of {several} models together"),
    };
    let chart = Chart {
        measure: "× 100",
        panels,
        columns: 3,
        note: format!(
            "{models}; the band of an AUC is its 95 % interval by {}; strict parsing",
            findings.unit
        ),
    };
    Some(Drawing {
        name: "fidelity",
        caption: "Does a better picture mean better answers? Between conditions: how similar the images are to their clean frames \
                  and how many answers are right. Within a condition: AUC of PSNR, 50 is chance. PSNR and the AUC of SSIM are in the table."
            .to_owned(),
        chart: Drawn::Lines(chart),
    })
}

fn is_curve(line: &PlotLine) -> bool {
    matches!(line.content, PanelContent::Curve(_))
}

fn panel(
    lights: &BTreeMap<Light<'_>, Vec<&ConditionFidelity>>,
    axis: Axis,
    (title, quantity, chance): (&str, Quantity, Option<f64>),
) -> Panel {
    let curves = lights.iter().enumerate();
    let of_axis =
        curves.filter(|(_, ((variant, _), _))| variant.kind.map(Kind::axis) == Some(axis));
    let curves = of_axis.filter_map(|(style, ((variant, enhancer), rows))| {
        let points: Vec<_> = rows
            .iter()
            .filter_map(|row| Some((row.level, quantity(row)?)))
            .collect();
        (!points.is_empty()).then(|| PlotLine {
            name: light(variant, *enhancer),
            style: LineStyle(style),
            content: PanelContent::Curve(points),
            model: None,
            items: None,
        })
    });
    let chance = chance.map(|share| PlotLine {
        name: "chance".to_owned(),
        style: CHANCE,
        content: PanelContent::Flat(share),
        model: None,
        items: None,
    });
    Panel {
        title: title.to_owned(),
        lines: curves.chain(chance).collect(),
        model: None,
    }
}

/// A number without an interval.
fn known(value: impl Into<Option<f64>>) -> Option<Estimate> {
    value.into().map(|value| Estimate {
        value,
        low: value,
        high: value,
        n: 0,
    })
}
