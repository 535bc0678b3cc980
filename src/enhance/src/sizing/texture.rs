//! Images for trials of a model, made without one of the user's: [`texture`].

use std::ops::RangeInclusive;

use darkqa_ground::types::Rgb;

/// UnclampedImage of the trial images: one as dark as an underexposed photograph, one with the whole range, and one nearly black, for gates that
/// brighter images saturate. Black is left out, as some models divide by it.
pub(crate) const CODES: [RangeInclusive<u8>; 3] = [4..=40, 4..=251, 1..=12];

/// An image whose samples look like noise within a range of codes, the same at each call.
pub(crate) fn texture([height, width]: [usize; 2], codes: &RangeInclusive<u8>) -> Rgb {
    let mut image = Rgb::black(height, width);
    let span = u32::from(codes.end() - codes.start()) + 1;
    let mut state = 1_u32;
    for sample in image.samples_mut() {
        // A linear congruential generator (Numerical Recipes, section 7.1).
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *sample = codes.start() + ((state >> 16) % span) as u8;
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textures_have_the_codes_and_are_the_same_each_time() {
        let image = texture([40, 60], &CODES[0]);
        assert_eq!(image, texture([40, 60], &CODES[0]));
        let codes = image.samples();
        assert_eq!(
            (codes.iter().min(), codes.iter().max()),
            (Some(&4), Some(&40))
        );
    }
}
