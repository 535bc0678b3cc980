//! Residual histograms on a logarithmic axis, as SVG: [`histogram`].

use plotters::prelude::*;

use crate::error::{Error, Result};

/// Minimum share that is drawn.
const MIN_SHARE: f64 = 1e-7;

/// Colours of the lines in their order (chosen): one for the real images, and two for each of four light readings.
const COLOURS: [RGBColor; 9] = [
    BLACK,
    RED,
    BLUE,
    GREEN,
    MAGENTA,
    CYAN,
    RGBColor(230, 159, 0),
    RGBColor(110, 110, 110),
    RGBColor(120, 60, 20),
];

/// One line of the figure.
#[derive(Debug, Clone)]
pub(crate) struct HistogramLine {
    /// Name in the legend.
    pub name: String,
    /// Differences of 8-bit codes with their shares.
    pub shares: Vec<(i32, f64)>,
}

/// Shares of residuals by their size in 8-bit codes. A gap in a line is a residual that does not occur.
///
/// # Errors
/// If the figure cannot be drawn.
pub(crate) fn histogram(title: &str, lines: &[HistogramLine]) -> Result<String> {
    let failed = |e: String| Error::data("figure", e);
    let max_difference = lines
        .iter()
        .flat_map(|line| &line.shares)
        .filter(|(_, share)| *share > MIN_SHARE)
        .map(|(difference, _)| difference.abs())
        .max()
        .map_or(8, |max_difference| max_difference.max(8));
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (900, 520)).into_drawing_area();
        root.fill(&WHITE).map_err(|e| failed(e.to_string()))?;
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(70)
            .build_cartesian_2d(
                -max_difference..max_difference,
                (MIN_SHARE..1.0).log_scale(),
            )
            .map_err(|e| failed(e.to_string()))?;
        chart
            .configure_mesh()
            .x_desc("residual in 8-bit codes")
            .y_desc("share of samples")
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .y_label_formatter(&|share| format!("{share:.0e}"))
            .draw()
            .map_err(|e| failed(e.to_string()))?;
        for (line, colour) in lines.iter().zip(COLOURS.iter().cycle()) {
            let runs = line.shares.split(|(difference, share)| {
                *share <= MIN_SHARE || difference.abs() > max_difference
            });
            for (index, run) in runs.filter(|run| !run.is_empty()).enumerate() {
                let points = run.iter().copied();
                let drawn = chart
                    .draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))
                    .map_err(|e| failed(e.to_string()))?;
                if index == 0 {
                    drawn.label(&line.name).legend(move |(x, y)| {
                        PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2))
                    });
                }
                // A residual between two that do not occur is drawn as a dot, because a line of one point is invisible.
                if run.len() == 1 {
                    let dots = points.map(|point| Circle::new(point, 3, colour.filled()));
                    chart.draw_series(dots).map_err(|e| failed(e.to_string()))?;
                }
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK)
            .label_font(("sans-serif", 15))
            .draw()
            .map_err(|e| failed(e.to_string()))?;
        root.present().map_err(|e| failed(e.to_string()))?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_is_drawn_and_named() {
        let line = |name: &str, shares: &[(i32, f64)]| HistogramLine {
            name: name.to_owned(),
            shares: shares.to_vec(),
        };
        let lines = [
            line(
                "real",
                &[(-1, 0.25), (0, 0.5), (1, 0.25), (2, 0.0), (3, 1e-5)],
            ),
            line("alone", &[(0, 1.0)]),
        ];
        let svg = histogram("residuals", &lines).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("real") && svg.contains("alone"));
        assert!(svg.contains("<polyline") && svg.contains("<circle"));
        assert_eq!(svg, histogram("residuals", &lines).unwrap());
        assert!(histogram("nothing", &[]).is_ok());
    }
}
