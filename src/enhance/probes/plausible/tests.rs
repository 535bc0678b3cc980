use super::*;

/// A dark image with structure and colour, in codes: squares of different light on a ramp, most of them warm, some
/// blue.
fn dark() -> UnclampedImage {
    let (height, width) = (96_u32, 144_u32);
    let pixels = (0..height).flat_map(|y| {
        (0..width).map(move |x| {
            let square = (x / 12 * 7919 + y / 12 * 104_729).wrapping_mul(2_654_435_761) >> 24;
            let light = 3.0 + 10.0 * x as f32 / width as f32 + square as f32 / 16.0;
            match square % 5 {
                0 => [0.5 * light, 0.8 * light, 1.2 * light],
                _ => [1.4 * light, light, 0.5 * light],
            }
        })
    });
    UnclampedImage {
        height: height as usize,
        width: width as usize,
        samples: pixels.flatten().map(f32::round).collect(),
    }
}

fn each(codes: &UnclampedImage, change: impl Fn(f32) -> f32) -> UnclampedImage {
    UnclampedImage { samples: codes.samples.iter().map(|code| change(*code)).collect(), ..codes.clone() }
}

/// Output of a good enhancer: four times the light.
fn good() -> UnclampedImage {
    each(&dark(), |code| 4.0 * code)
}

fn flaw(made: &UnclampedImage) -> Option<Flaw> {
    judge(&dark(), made).map(|verdict| verdict.flaw)
}

#[test]
fn an_enhanced_image_has_no_flaw() {
    assert_eq!(flaw(&good()), None);
    // A curve, an offset and noise are no flaws.
    assert_eq!(flaw(&each(&dark(), |code| 255.0 * (code / 255.0).powf(0.4))), None);
    let mut state = 1_u32;
    let mut noisy = good();
    for sample in &mut noisy.samples {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *sample += (state >> 24) as f32 / 8.0 - 16.0;
    }
    assert_eq!(flaw(&noisy), None);
}

#[test]
fn each_wrong_decoding_has_its_flaw() {
    let good = good();
    let swapped = {
        let mut made = good.clone();
        made.samples.chunks_exact_mut(3).for_each(|pixel| pixel.swap(0, 2));
        made
    };
    let planes_as_pixels = {
        let planes = (0..3).flat_map(|channel| good.samples.iter().skip(channel).step_by(3));
        UnclampedImage { samples: planes.copied().collect(), ..good.clone() }
    };
    let mut grey = good.clone();
    for pixel in grey.samples.chunks_exact_mut(3) {
        pixel.fill(pixel[1]);
    }
    let mut not_a_number = good.clone();
    not_a_number.samples[7] = f32::NAN;
    let cases = [
        (not_a_number, Flaw::Nan),
        (each(&good, |code| 255.0 * code), Flaw::Range),
        (each(&good, |_| 90.0), Flaw::Flat),
        (dark(), Flaw::Unlit),
        (each(&dark(), |code| code / 255.0), Flaw::Flat),
        (each(&good, |code| if code > 14.0 { 255.0 } else { 0.0 }), Flaw::White),
        (each(&good, |code| 255.0 - code), Flaw::Inverted),
        (planes_as_pixels, Flaw::Shuffled),
        (swapped, Flaw::Hue),
        (grey, Flaw::Grey),
        (each(&good, |code| f32::midpoint(code, 255.0)), Flaw::Haze),
    ];
    for (made, expected) in cases {
        assert_eq!(flaw(&made), Some(expected));
        assert!(!judge(&dark(), &made).unwrap().to_string().is_empty());
    }
}

#[test]
fn a_pale_room_is_no_haze() {
    let pale = each(&dark(), |code| 6.0 + code / 4.0);
    let made = each(&pale, |code| 16.0 * code);
    assert_eq!(judge(&pale, &made), None);
    let hazy = each(&good(), |code| f32::midpoint(code, 255.0));
    assert_eq!(judge(&dark(), &hazy).unwrap().flaw, Flaw::Haze);
    // The rule compares with the dark frame: a pale output of a frame with dark pixels is a haze.
    assert_eq!(judge(&dark(), &made).unwrap().flaw, Flaw::Haze);
}

#[test]
fn black_output_is_impossible_and_unlit_output_doubtful() {
    for (output, gravity) in
        [(each(&dark(), |code| 0.4 * code), Gravity::Impossible), (each(&dark(), |code| code + 1.0), Gravity::Doubtful)]
    {
        assert_eq!(judge(&dark(), &output).unwrap().gravity, gravity);
    }
}

#[test]
fn images_smaller_than_a_block_are_judged_too() {
    for (height, width) in [(1, 1), (3, 200), (200, 3), (4, 4)] {
        let image = UnclampedImage { height, width, samples: vec![3.0; height * width * 3] };
        assert_eq!(judge(&image, &image).unwrap().flaw, Flaw::Flat);
        let mut made = image.clone();
        for (place, sample) in made.samples.iter_mut().enumerate() {
            *sample = 20.0 + (place % 5) as f32 * 10.0;
        }
        // No figure may be a division by zero.
        if let Some(verdict) = judge(&image, &made) {
            assert!(verdict.figure.is_finite());
        }
    }
}

#[test]
fn brightness_is_the_mean_luma() {
    let image = Rgb::new(1, 2, vec![255, 0, 0, 0, 0, 255]).unwrap();
    assert!((brightness(&image) - 255.0 * (0.299 + 0.114) / 2.0).abs() < 1e-9);
}
