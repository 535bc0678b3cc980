#!/usr/bin/env bash
# The crate image reads a TIFF of uint32 RGB as float RGB, with the bits of each integer taken for a float.
#
# Guess: it is refused, as uint32 grey is, or brought to 16 bits.
# Seen with image 0.25.10 (tiff 0.11.3), tifffile 2026.3.3 and numpy 2.4.6: the picture comes out as Rgb32F. White,
# 4294967295, is NaN; half of it, 2147483648, is -0; 1000000000 is 0.0047; 65535 is 9e-41. No error is raised. So
# a sum of exposures kept as uint32 is read as a dark picture of noise, NaN and negative values.
# Builds a small program with cargo.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check tifffile==2026.3.3 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys

import numpy as np
import tifffile

rgb = np.zeros((2, 2, 3), np.uint32)
rgb[0] = [[4294967295, 2147483648, 1000000000], [65535, 0, 1]]
tifffile.imwrite(f"{sys.argv[1]}/rgb.tif", rgb, photometric="rgb")
tifffile.imwrite(f"{sys.argv[1]}/grey.tif", rgb[..., 0], photometric="minisblack")
print(f"tifffile {tifffile.__version__}, numpy {np.__version__}, written: {rgb[0].tolist()}")
PYTHON
mkdir "$folder/src"
cat > "$folder/Cargo.toml" <<'TOML'
[package]
name = "probe"
version = "0.1.0"
edition = "2021"
[dependencies]
image = { version = "=0.25.10", default-features = false, features = ["tiff"] }
tiff = "=0.11.3"
TOML
cat > "$folder/src/main.rs" <<'RUST'
use image::DynamicImage;

fn main() {
    let folder = std::env::args().nth(1).unwrap();
    let grey = image::open(format!("{folder}/grey.tif"));
    println!("uint32 grey: {:?}", grey.as_ref().err().map(|error| error.to_string()));
    let rgb = image::open(format!("{folder}/rgb.tif")).unwrap();
    println!("uint32 RGB: {:?}", rgb.color());
    let DynamicImage::ImageRgb32F(rgb) = rgb else { std::process::exit(1) };
    let found: Vec<f32> = rgb.as_raw()[..6].to_vec();
    println!("first values: {found:?}");
    let bits: Vec<u32> = found.iter().map(|value| value.to_bits()).collect();
    let as_said = bits == [4294967295, 2147483648, 1000000000, 65535, 0, 1] && grey.is_err();
    std::process::exit(i32::from(!as_said));
}
RUST
cd "$folder" && echo "image 0.25.10" && cargo run --quiet -- "$folder"
