//! Division of panels with many curves into several panels: [`split`].

use crate::charts::chart::{Panel, PlotLine};

/// Maximum number of curves per panel: the number of colours in the palette.
const MAX_CURVES: usize = 6;

/// Divides panels so that each has at most [`MAX_CURVES`] curves. A line that is not a curve stays with the curves of
/// its model; if its model has no curve, the line appears in every part.
pub fn split(panels: Vec<Panel>) -> Vec<Panel> {
    panels.into_iter().flat_map(split_panel).collect()
}

fn split_panel(panel: Panel) -> Vec<Panel> {
    let count = panel.lines.iter().filter(|line| line.is_curve()).count();
    if count <= MAX_CURVES {
        return vec![panel];
    }
    let (curves, other_lines): (Vec<PlotLine>, Vec<PlotLine>) = panel.lines.into_iter().partition(PlotLine::is_curve);
    // Equal parts; the last one may have fewer curves.
    let parts = count.div_ceil(MAX_CURVES);
    let size = count.div_ceil(parts);
    curves
        .chunks(size)
        .enumerate()
        .map(|(part, part_curves)| Panel {
            title: format!("{} ({} of {parts})", panel.title, part + 1),
            x: panel.x.clone(),
            y: panel.y.clone(),
            model: panel.model.clone(),
            lines: part_curves
                .iter()
                .chain(other_lines.iter().filter(|line| share_model(part_curves, line) || !share_model(&curves, line)))
                .cloned()
                .collect(),
        })
        .collect()
}

/// True if a curve is about the same model as the line.
fn share_model(curves: &[PlotLine], line: &PlotLine) -> bool {
    curves.iter().any(|curve| curve.model == line.model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::chart::{LineContent, LineStyle};

    fn line(name: &str, content: LineContent, model: Option<&str>) -> PlotLine {
        PlotLine { name: name.to_owned(), style: LineStyle(0), content, model: model.map(str::to_owned), items: None }
    }

    fn panel(curves: usize) -> Panel {
        let names: Vec<String> = (0..curves).map(|index| format!("m{index}")).collect();
        let curves = names.iter().map(|name| line(name, LineContent::Curve(Vec::new()), Some(name)));
        let others = [
            line("m0 without images", LineContent::Flat(0.4), Some("m0")),
            line("chance", LineContent::Flat(0.3), None),
        ];
        Panel::over_levels("accuracy in %", "t".to_owned(), curves.chain(others).collect())
    }

    fn line_names(panel: &Panel) -> Vec<&str> {
        panel.lines.iter().map(|line| line.name.as_str()).collect()
    }

    #[test]
    fn no_panel_has_more_than_six_curves() {
        assert_eq!(split(vec![panel(6)]).len(), 1);
        let parts = split(vec![panel(7)]);
        assert_eq!(line_names(&parts[0]), ["m0", "m1", "m2", "m3", "m0 without images", "chance"]);
        assert_eq!(line_names(&parts[1]), ["m4", "m5", "m6", "chance"]);
        assert_eq!(parts[1].title, "t (2 of 2)");
    }
}
