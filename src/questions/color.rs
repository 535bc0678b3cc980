//! "What color is the sofa in the image?"
//!
//! Colours relative to the light: [`relative_code`].

use std::sync::LazyLock;

use serde_json::json;

use super::colors::{Color, Palette};
use super::reason::Reason;
use super::rule_context::{Candidate, RuleContext, RuleResult, rejected};
use super::rules::{ClassFlag, ColorChoices, ColorRule};
use super::statistics::{Segment, ppm};
use darkqa_base::types::Family;

/// Returns one candidate for every segment of a class whose colour may be asked.
pub(super) fn candidates(context: &RuleContext<'_>, palette: &Palette) -> Vec<RuleResult> {
    context
        .statistics
        .segments
        .iter()
        .filter(|segment| context.book.has_flag(&segment.class, ClassFlag::Color))
        .map(|segment| {
            let result = candidate(context, segment, palette);
            result.unwrap_or_else(|reason| rejected(Family::Color, &segment.class, None, reason))
        })
        .collect()
}

fn candidate(context: &RuleContext<'_>, segment: &Segment, palette: &Palette) -> Result<RuleResult, Reason> {
    let rule = &context.book.color;
    if let Some(reason) = context.statistics.evidence_flaw(segment, context.book) {
        return Err(reason);
    }
    if context.statistics.area_ppm(segment) < rule.area_ppm || segment.core < rule.eroded_px {
        return Err(Reason::Small);
    }
    if !is_unique(context, segment) {
        return Err(Reason::NotUnique);
    }
    let word = segment.question_word(context.book).ok_or(Reason::Wordless)?;
    let color = dominant_color(segment, rule, palette)?;
    check_light(context, segment, color, palette)?;
    if context.views.has_other_color(context.statistics, segment, color) {
        return Err(Reason::Disagreed);
    }
    let (choices, truth) = choices(context, color).ok_or(Reason::NotOffered)?;
    let (_, most, next, none) = segment.leading_color();
    let [most, next, none] = [most, next, none].map(|part| ppm(part, segment.core));
    let evidence = json!({
        "core_px": segment.core,
        "dominant_ppm": most,
        "second_ppm": next,
        "nameless_ppm": none,
        "median_rgb": segment.median,
        "light_rgb": context.statistics.light,
        "around_luma": segment.around,
    });
    let text = context.book.fill_template(&rule.text, &rule.plural, word);
    Ok(context.viable(
        Candidate { family: Family::Color, about: segment.class.clone(), text, choices, truth, evidence },
        &[segment],
    ))
}

/// True if a segment is the only visible one of its class. Pixels of the class outside all segments count as another
/// segment.
fn is_unique(context: &RuleContext<'_>, segment: &Segment) -> bool {
    let (statistics, min_ppm) = (context.statistics, context.book.color.lone_ppm);
    let loose = statistics.loose.get(&segment.class).copied().unwrap_or(0);
    let has_other = statistics
        .segments
        .iter()
        .any(|other| other.class == segment.class && other.id != segment.id && statistics.area_ppm(other) >= min_ppm);
    !has_other && statistics.ppm(loose) < min_ppm
}

/// Colour of a segment, if one colour clearly dominates.
fn dominant_color(segment: &Segment, rule: &ColorRule, palette: &Palette) -> Result<Color, Reason> {
    let (color, most, next, none) = segment.leading_color();
    let share = |part| ppm(part, segment.core);
    let color = color.ok_or(Reason::Nameless)?;
    if color != Color::White && share(segment.bright) > rule.bright_ppm {
        return Err(Reason::Bright);
    }
    if color != Color::Black && share(segment.crushed) > rule.crushed_ppm {
        return Err(Reason::Crushed);
    }
    if share(none) >= rule.none_ppm {
        return Err(Reason::Nameless);
    }
    let is_dominant = share(most) >= rule.dominant_ppm && most >= rule.lead * next;
    if !is_dominant || palette.color(segment.median) != Some(color) {
        return Err(Reason::Motley);
    }
    Ok(color)
}

/// Checks that the colour keeps its name relative to the light of the frame, channel by channel, and relative to the
/// luma around the segment. The colour around the segment is ignored, because it is that of its neighbours.
fn check_light(context: &RuleContext<'_>, segment: &Segment, color: Color, palette: &Palette) -> Result<(), Reason> {
    let lights = [Some(context.statistics.light), segment.around.map(|luma| [luma; 3])];
    if lights.into_iter().flatten().all(|light: [u8; 3]| {
        palette.color([0, 1, 2].map(|channel: usize| relative_code(segment.median[channel], light[channel])))
            == Some(color)
    }) {
        Ok(())
    } else {
        Err(Reason::Lit)
    }
}

/// Returns the colours offered as choices, and the index of the true one; `None` if it is not among them.
fn choices(context: &RuleContext<'_>, truth: Color) -> Option<(Vec<String>, usize)> {
    let rule = &context.book.color;
    let mut colors = match rule.candidates {
        ColorChoices::All11 => Color::ALL.to_vec(),
        ColorChoices::Fixed8 => rule.fixed8.clone(),
        ColorChoices::K5 => {
            let mut others: Vec<Color> = Color::ALL
                .into_iter()
                .filter(|color| *color != truth)
                .filter(|color| {
                    !rule.neighbours.contains(&[*color, truth]) && !rule.neighbours.contains(&[truth, *color])
                })
                .collect();
            context.picker.shuffle("color", &mut others);
            others.truncate(4);
            others.push(truth);
            others
        }
    };
    if rule.candidates == ColorChoices::K5 {
        colors.sort_unstable();
    }
    let index = colors.iter().position(|color| *color == truth)?;
    Some((colors.into_iter().map(|color| color.name().to_owned()).collect(), index))
}

/// Linear light of each sRGB code in 65,535ths (IEC 61966-2-1), rounded.
static LINEAR: LazyLock<[u64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        let light = if value > 0.04045 { libm::pow((value + 0.055) / 1.055, 2.4) } else { value / 12.92 };
        (light * 65_535.0).round() as u64
    })
});

/// Returns the code that a surface would have if light with code `light` were white: the nearest code of the linear
/// light of `code` divided by that of `light` (von Kries 1902, for each channel). White if the surface is brighter than
/// the light.
fn relative_code(code: u8, light: u8) -> u8 {
    let white = LINEAR[usize::from(light)].max(1);
    let share = (LINEAR[usize::from(code)] * 65_535 / white).min(65_535);
    let above = LINEAR.partition_point(|value| *value < share).min(255);
    let below = above.saturating_sub(1);
    let nearer_below = share.abs_diff(LINEAR[below]) < share.abs_diff(LINEAR[above]);
    (if nearer_below { below } else { above }) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_relative_to_white_is_unchanged() {
        for code in 0..=255 {
            assert_eq!(relative_code(code, 255), code);
            assert_eq!(relative_code(code, code.max(1)), if code == 0 { 0 } else { 255 });
        }
    }

    #[test]
    fn half_the_light_doubles_the_linear_code() {
        // Code 188 is half of the linear light of white (0.5029); code 137 (0.2502) is 0.4975 of that, and 187 is
        // 0.4969 of white.
        assert_eq!((relative_code(188, 188), relative_code(137, 188)), (255, 187));
        assert_eq!(relative_code(200, 188), 255);
    }
}
