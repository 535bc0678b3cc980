#!/usr/bin/env bash
# The crate image refuses a colour TIFF with JPEG inside as tifffile writes it, and tiff reads it without making it RGB.
#
# Guess: it reads as RGB, close to what Pillow gives, as the crate tiff lists JPEG and YCbCr.
# Seen with image 0.25.10 and tiff 0.11.3 against pillow 13.0.0, tifffile 2026.3.3 (imagecodecs 2026.3.6) and
# numpy 2.4.6: image says "does not support the color type `Unknown(24)`". The crate tiff decodes it, says YCbCr(8),
# and hands out luma and chroma as they are. A JPEG in a TIFF whose tag says RGB, as Pillow writes, is read by both.
# So whether such a scan can be read depends on its writer.
# Builds a small program with cargo.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  pillow==13.0.0 tifffile==2026.3.3 imagecodecs==2026.3.6 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys

import numpy as np
import PIL
import tifffile
from PIL import Image

print(f"pillow {PIL.__version__}, tifffile {tifffile.__version__}, numpy {np.__version__}")
red = np.full((16, 16, 3), [254, 0, 0], np.uint8)
tifffile.imwrite(f"{sys.argv[1]}/tifffile.tif", red, photometric="rgb", compression="jpeg")
Image.fromarray(red).save(f"{sys.argv[1]}/pillow.tif", compression="jpeg")
for name in ("tifffile", "pillow"):
    with Image.open(f"{sys.argv[1]}/{name}.tif") as image:
        print(f"written by {name}: photometric tag {image.tag_v2[262]}, in Pillow {image.getpixel((3, 3))}")
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
use tiff::decoder::{Decoder, DecodingResult};

fn main() {
    let folder = std::env::args().nth(1).unwrap();
    let mut seen = Vec::new();
    for name in ["tifffile", "pillow"] {
        let path = format!("{folder}/{name}.tif");
        let read = image::open(&path).map(|image| image.to_rgb8()[(3, 3)].0).map_err(|error| error.to_string());
        let mut decoder = Decoder::new(std::fs::File::open(&path).unwrap()).unwrap();
        let kind = decoder.colortype().unwrap();
        let DecodingResult::U8(values) = decoder.read_image().unwrap() else { std::process::exit(1) };
        println!("written by {name}: image {read:?}, tiff {kind:?} {:?}", &values[..3]);
        seen.push((read, values[..3].to_vec()));
    }
    let luma = seen[0].1[0] < 100 && seen[0].1[2] > 200;
    let as_said = seen[0].0.is_err() && luma && seen[1].0.as_ref().is_ok_and(|pixel| pixel[0] > 240);
    std::process::exit(i32::from(!as_said));
}
RUST
cd "$folder" && echo "image 0.25.10, tiff 0.11.3" && cargo run --quiet -- "$folder"
