//! Colours relative to the light: [`relative_code`].

use std::sync::LazyLock;

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
pub(super) fn relative_code(code: u8, light: u8) -> u8 {
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
