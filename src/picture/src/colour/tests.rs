use super::*;

fn is_srgb(tag: &ColourTag) -> bool {
    matches!(tag.meaning(CodeDepth::Eight), Ok(Meaning::Srgb))
}

fn gamma(exponent: Option<u32>, primaries: Option<[u32; 8]>) -> ColourTag {
    ColourTag::Gamma(Gamma {
        exponent,
        primaries,
    })
}

const SRGB: [u32; 8] = [
    31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000,
];
const P3: [u32; 8] = [
    31_270, 32_900, 68_000, 32_000, 26_500, 69_000, 15_000, 6_000,
];

#[test]
fn gamma_and_primaries_of_srgb_are_srgb() {
    let rounded = [
        31_269, 32_899, 63_999, 33_001, 30_000, 60_000, 15_000, 5_999,
    ];
    for (exponent, primaries) in [
        (Some(45_455), None),
        (Some(45_455), Some(SRGB)),
        (None, Some(SRGB)),
        (Some(45_405), None),
        (Some(45_505), Some(rounded)),
    ] {
        assert!(is_srgb(&gamma(exponent, primaries)), "{exponent:?}");
    }
    for (exponent, primaries, expected) in [
        (Some(45_404), None, "is 0.45404; 0.45455 (sRGB) expected"),
        (Some(45_506), None, "is 0.45506"),
        (Some(55_556), Some(SRGB), "is 0.55556"),
        (Some(100_000), None, "is 1; 0.45455"),
        (Some(45_455), Some(P3), "red 0.68, 0.32"),
        (None, Some(P3), "cHRM"),
    ] {
        let problem = gamma(exponent, primaries)
            .meaning(CodeDepth::Eight)
            .unwrap_err();
        assert!(problem.contains(expected), "{problem}");
        assert!(problem.contains("--decode colour=ignore"), "{problem}");
    }
}

#[test]
fn linear_light_needs_16_bits() {
    let linear = gamma(Some(100_000), Some(SRGB));
    assert!(matches!(
        linear.meaning(CodeDepth::Sixteen),
        Ok(Meaning::Linear)
    ));
    assert!(linear.meaning(CodeDepth::Eight).is_err());
    let of_p3 = gamma(Some(100_000), Some(P3));
    assert!(of_p3.meaning(CodeDepth::Sixteen).is_err());
}

#[test]
fn code_points_are_converted_or_refused_by_name() {
    assert!(is_srgb(&ColourTag::CodePoints([1, 13, 0, 1])));
    for (points, name) in [([1, 1, 0, 1], "BT.709"), ([12, 13, 0, 1], "Display P3")] {
        let Ok(Meaning::Other(space)) = ColourTag::CodePoints(points).meaning(CodeDepth::Eight)
        else {
            panic!("{name}")
        };
        let note = space.note(ColourHandling::Converted);
        assert_eq!((&*note.from, note.profile), (name, None));
    }
    for (points, expected) in [
        ([9, 16, 0, 1], "PQ"),
        ([9, 18, 0, 1], "HLG"),
        ([1, 13, 0, 0], "narrow range"),
        ([12, 13, 0, 0], "narrow range"),
        ([9, 1, 0, 1], "9/1/0/1 (cICP)"),
        ([1, 13, 1, 1], "1/13/1/1 (cICP)"),
    ] {
        let problem = ColourTag::CodePoints(points)
            .meaning(CodeDepth::Eight)
            .unwrap_err();
        assert!(
            problem.contains(expected) && problem.contains("--decode colour=ignore"),
            "{problem}"
        );
    }
}

/// Black and white stay; other BT.709 codes become the sRGB codes of the same light.
#[test]
fn bt709_codes_are_converted_to_srgb() {
    let Ok(Meaning::Other(space)) = ColourTag::CodePoints([1, 1, 0, 1]).meaning(CodeDepth::Eight)
    else {
        panic!("BT.709")
    };
    let mut samples = [0, 255, 128, 10, 20, 200];
    space.conversion.convert_8(&mut samples);
    let expected = [0, 255, 128, 10, 20, 200].map(|code: u8| {
        let value = f64::from(code) / 255.0;
        let light = if value < 0.081 {
            value / 4.5
        } else {
            ((value + 0.099) / 1.099).powf(1.0 / 0.45)
        };
        let value = if light <= 0.003_130_8 {
            12.92 * light
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * value).round() as u8
    });
    assert_eq!(samples, expected);
    assert_ne!(samples, [0, 255, 128, 10, 20, 200]);
}

/// An ICC profile with this colour space, connection space and one empty tag.
fn profile_header([space, connection, tag]: [&[u8; 4]; 3]) -> Vec<u8> {
    let mut profile = vec![0; 128];
    profile[16..20].copy_from_slice(space);
    profile[20..24].copy_from_slice(connection);
    profile.extend(1_u32.to_be_bytes());
    profile.extend(tag);
    profile.extend([0; 8]);
    profile
}

#[test]
fn unsupported_profiles_are_refused_by_name() {
    for (profile, expected) in [
        (profile_header([b"CMYK", b"Lab ", b"A2B0"]), "for CMYK"),
        (profile_header([b"Lab ", b"XYZ ", b"desc"]), "for Lab"),
        (
            profile_header([b"HSV ", b"XYZ ", b"desc"]),
            "of the kind \"HSV\"",
        ),
        (
            profile_header([b"RGB ", b"XYZ ", b"A2B1"]),
            "by tables (A2B)",
        ),
        (
            profile_header([b"RGB ", b"Lab ", b"rXYZ"]),
            "connection space of the ICC profile",
        ),
        (profile_header([b"RGB ", b"XYZ ", b"rXYZ"]), "broken"),
        (vec![0; 100], "ends too early"),
    ] {
        let problem = ColourTag::Profile(profile)
            .meaning(CodeDepth::Eight)
            .unwrap_err();
        assert!(problem.contains(expected), "{expected}: {problem}");
        assert!(problem.contains("ICC profile") && problem.contains("--decode colour=ignore"));
    }
    for chunk in [&b"no end of the name"[..], b"name\0", b"name\0\0no deflate"] {
        let problem = ColourTag::DeflatedProfile(chunk.to_vec())
            .meaning(CodeDepth::Eight)
            .unwrap_err();
        assert!(problem.contains("cannot be decompressed"), "{problem}");
    }
}
