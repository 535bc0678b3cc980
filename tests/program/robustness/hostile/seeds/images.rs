//! Images in all forms, models that enhance them, and frames with maps.

use std::fs;

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};

use crate::robustness::hostile::random::Random;
use crate::support::exr_files::exr;
use crate::support::icc_files::{DISPLAY_P3, rgb_profile, srgb_curve};
use crate::support::image_files::{encoded, jpeg, png, png_with_profile, turned_jpeg, turned_webp};
use crate::support::onnx;
use crate::support::run::{Bench, words};
use crate::support::tiff_files::{Order, Page, tiff};

pub(super) fn make(bench: &Bench) {
    let picture = picture();
    bench.file("a.png", png(&picture));
    bench.file("b.png", crate::support::frames::png(40));
    forms(bench, &picture);
    for (folder, shade) in [("cat", 40), ("dog", 90), ("sofa", 140)] {
        let flat = RgbImage::from_pixel(16, 16, Rgb([shade, 60, 30]));
        bench.file(&format!("labelled/{folder}/0.png"), png(&flat));
        bench.file(&format!("labelled/{folder}/1.jpg"), jpeg(&flat));
    }
    for name in ["a", "b"] {
        bench.file(&format!("pairs/normal/{name}.png"), png(&picture));
        let dark = RgbImage::from_fn(16, 16, |x, y| Rgb(picture.get_pixel(x, y).0.map(|c| c / 4)));
        bench.file(&format!("pairs/low/{name}.png"), png(&dark));
    }
    let folder = bench.path("");
    fs::create_dir_all(folder.join("models")).unwrap();
    onnx::gain(0.5).write(&folder, "models/gain.onnx");
    onnx::two_outputs().write(&folder, "models/two.onnx");
    onnx::external_gain("factor.bin").write(&folder, "models/external.onnx");
    bench.file("models/factor.bin", 0.5_f32.to_le_bytes());
    let sidecar = "output = 1\nrange_in = \"0..1\"\nrange_out = \"0..1\"\nmultiple = 8\npad = \"reflect\"\n";
    bench.file("models/two.onnx.toml", sidecar);
    bench.complete(&words("rooms --frames 2 --size 32x32 --out frames"));
    recording(bench);
}

fn picture() -> RgbImage {
    RgbImage::from_fn(16, 16, |x, y| Rgb([(x * 15) as u8, (y * 13) as u8, 90]))
}

/// The picture in each form that is read.
fn forms(bench: &Bench, picture: &RgbImage) {
    let colour = DynamicImage::ImageRgb8(picture.clone());
    let save = |name: &str, image: &DynamicImage, format: ImageFormat| {
        let mut file = std::io::Cursor::new(Vec::new());
        image.write_to(&mut file, format).unwrap();
        bench.file(&format!("photos/{name}"), file.into_inner());
    };
    save("grey.png", &DynamicImage::ImageLuma8(colour.to_luma8()), ImageFormat::Png);
    save("deep.png", &DynamicImage::ImageRgb16(colour.to_rgb16()), ImageFormat::Png);
    save("alpha.png", &DynamicImage::ImageRgba8(colour.to_rgba8()), ImageFormat::Png);
    save("plain.bmp", &colour, ImageFormat::Bmp);
    bench.file("photos/palette.png", palette());
    let profile = rgb_profile("Display P3", DISPLAY_P3, &srgb_curve());
    bench.file("photos/profile.png", png_with_profile(picture, &profile));
    bench.file("photos/turned.jpg", turned_jpeg(&jpeg(picture), 6));
    bench.file("photos/mirrored.webp", turned_webp(picture, 5));
    bench.file("photos/whole.webp", encoded(picture, ImageFormat::WebP));
    bench.file("photos/page.tiff", tiff(Order::Little, &[Page::rgb(picture)]));
    let mut progressive = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut progressive, 80);
    encoder.set_progressive(true);
    let colours = jpeg_encoder::ColorType::Rgb;
    encoder.encode(picture, 16, 16, colours).unwrap();
    bench.file("photos/progressive.jpg", progressive);
    let light: Vec<f32> = picture.iter().map(|code| f32::from(*code) / 64.0).collect();
    bench.file("photos/light.exr", exr([16, 16], &light));
}

/// A PNG file with a palette of four colours, two bits a pixel.
fn palette() -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 16, 16);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Two);
    encoder.set_palette(vec![9, 9, 9, 200, 60, 30, 40, 90, 200, 250, 250, 250]);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0b0001_1011; 64]).unwrap();
    writer.finish().unwrap();
    file
}

/// A recording of a camera: bias frames and pairs of flats, as mosaics of 16 bits whose noise grows with the light.
fn recording(bench: &Bench) {
    let mut random = Random::new(3);
    let mut frame = |light: f64| {
        let sites = image::ImageBuffer::from_fn(256, 256, |_, _| {
            // Four uniform numbers from 0 to 1 have the variance 1/3.
            let uniform = (0..4).map(|_| random.below(1 << 20) as f64 / f64::from(1 << 20));
            let noise = (uniform.sum::<f64>() - 2.0) * (3.0 * (light + 9.0)).sqrt();
            image::Luma([(512.0 + light + noise).round() as u16])
        });
        let image = DynamicImage::ImageLuma16(sites);
        let mut file = std::io::Cursor::new(Vec::new());
        image.write_to(&mut file, ImageFormat::Png).unwrap();
        file.into_inner()
    };
    for (name, light) in LIGHTS {
        for number in 0..2 {
            let path = format!("recording/iso100/{name}/{number}.png");
            bench.file(&path, frame(light));
        }
    }
}

/// The bias frames and the flats of a recording, by the light above black.
const LIGHTS: [(&str, f64); 4] = [("bias", 0.0), ("flat-1", 300.0), ("flat-2", 1500.0), ("flat-3", 6000.0)];
