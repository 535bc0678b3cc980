//! Light in which the photographs of a data set were taken, for reports: [`PhotographedSet`].

use darkqa_base::types::SetLight;

/// Minimum mean linear brightness of photographs of well-lit scenes (chosen: a well-lit room has about 0.15, and 0.04
/// when two stops darker).
const BRIGHT: f64 = 0.08;

/// Light in which the photographs of a data set were taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhotographedSet {
    /// Whether the photographs were taken in the dark.
    pub light: SetLight,
    /// Mean linear luminance of a sample of the photographs, from 0 to 1, and size of the sample; `None` if it was not
    /// measured.
    pub brightness: Option<(f64, usize)>,
}

impl PhotographedSet {
    /// Notice to readers about a data set taken in the dark; `None` for other data sets.
    pub fn notice(self) -> Option<String> {
        if self.light == SetLight::Lit {
            return None;
        }
        let brightness = self.brightness.map(|(mean, frames)| {
            format!(
                " Their mean linear brightness is {mean:.4} of 1 (measured on {frames}); a mid-grey, code 128, is 0.22."
            )
        });
        let is_bright = self.brightness.is_some_and(|(mean, _)| mean >= BRIGHT);
        let doubt = if is_bright {
            " That is as bright as photographs in the light: if these are not from the dark, leave out --light dark."
        } else {
            ""
        };
        Some(format!(
            "These photographs were taken in the dark (--light dark): L0 is each as photographed, there is no image in the light to \
             compare with, and no darkness threshold.{}{doubt}",
            brightness.unwrap_or_default()
        ))
    }
}
