//! Figure of image fidelity and right answers by level: [`figure_spec`].

use std::collections::BTreeMap;

use crate::report::charts::chart::figure_chart::FigureChart;
use crate::report::charts::chart::{Chart, LineContent, LineStyle, Panel, PlotLine};
use crate::report::charts::figures::FigureSpec;
use crate::report::text::words::light;
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Variant};
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::ConditionFidelity;

/// Variant, and enhancer if there is one.
type Light<'f> = (&'f Variant, Option<&'f EnhancerName>);

/// Content of the panel of one quantity.
struct PanelSpec {
    title: &'static str,
    /// Reads the quantity, as a share, from the results of a condition.
    quantity: fn(&ConditionFidelity) -> Option<Estimate>,
    /// Value of the quantity by chance, drawn as a horizontal line.
    chance: Option<f64>,
}

const PANELS: [PanelSpec; 3] = [
    PanelSpec { title: "SSIM of the images", quantity: |row| without_interval(row.means[1]?), chance: None },
    PanelSpec { title: "share of right answers", quantity: |row| without_interval(row.accuracy), chance: None },
    PanelSpec { title: "AUC of PSNR", quantity: |row| Some(row.predicts[0]?.auc.estimate), chance: Some(0.5) },
];

/// Image similarity, accuracy, and how well similarity predicts right answers, by level: a row of panels for each axis,
/// and a line for each variant and enhancer. `None` if no image was measured.
pub(super) fn figure_spec(findings: &Findings<'_>) -> Option<FigureSpec> {
    let fidelity = findings.fidelity.as_ref()?;
    let mut lights = BTreeMap::<Light<'_>, Vec<&ConditionFidelity>>::new();
    for row in &fidelity.conditions {
        // Photographs in the dark are not at a level.
        if row.level != AxisLevel::PAIR {
            let light = (&row.variant, row.enhancer.as_ref());
            lights.entry(light).or_default().push(row);
        }
    }
    let panels: Vec<Panel> = Axis::ALL
        .into_iter()
        .flat_map(|axis| PANELS.map(|spec| panel(&lights, axis, &spec)))
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
        note: format!("{models}; the band of an AUC is its 95 % interval by {}; strict parsing", findings.unit),
    };
    Some(FigureSpec {
        name: "fidelity",
        caption: "Does a better picture mean better answers? Between conditions: how similar the images are to their clean frames \
                  and how many answers are right. Within a condition: AUC of PSNR, 50 is chance. PSNR and the AUC of SSIM are in the table."
            .to_owned(),
        chart: FigureChart::Lines(chart),
    })
}

fn is_curve(line: &PlotLine) -> bool {
    matches!(line.content, LineContent::Curve(_))
}

fn panel(lights: &BTreeMap<Light<'_>, Vec<&ConditionFidelity>>, axis: Axis, spec: &PanelSpec) -> Panel {
    let mut lines = Vec::new();
    for (style, ((variant, enhancer), rows)) in lights.iter().enumerate() {
        if variant.kind.map(Kind::axis) != Some(axis) {
            continue;
        }
        let points: Vec<_> = rows.iter().filter_map(|row| Some((row.level, (spec.quantity)(row)?))).collect();
        if !points.is_empty() {
            lines.push(PlotLine {
                name: light(variant, *enhancer),
                style: LineStyle(style),
                content: LineContent::Curve(points),
                model: None,
                items: None,
            });
        }
    }
    lines.extend(spec.chance.map(|share| PlotLine {
        name: "chance".to_owned(),
        style: LineStyle::REFERENCE,
        content: LineContent::Flat(share),
        model: None,
        items: None,
    }));
    Panel { title: spec.title.to_owned(), lines, model: None }
}

/// A number without an interval.
fn without_interval(value: impl Into<Option<f64>>) -> Option<Estimate> {
    value.into().map(|value| Estimate { value, low: value, high: value, n: 0 })
}
