//! Frames of other data sets as their authors lay them out, a few each.

use image::{GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage};

use crate::support::image_files::{jpeg, png};
use crate::support::lerobot::Set;
use crate::support::recording::{Compression, drive};
use crate::support::run::Bench;

const WIDTH: u32 = 8;
const HEIGHT: u32 = 6;

pub(super) fn make(bench: &Bench) {
    bench.file("drive.mcap", drive(2, Compression::Zstd));
    for (folder, version) in [("robot3", "v3.0"), ("robot2", "v2.1")] {
        let set = Set { version, ..Set::default() };
        set.write(&bench.path(folder));
    }
    habitat(bench);
    scannet(bench);
    let at = |name: &str| format!("nyu/{name}/00001.png");
    bench.file(&at("rgb"), png(&picture()));
    bench.file(&at("depth"), deep(10_000, 15_000));
    bench.file(&at("labels"), shallow(3, 255));
    sunrgbd(bench);
    bench.file("thor/FloorPlan201/rgb/0.png", png(&picture()));
    bench.file("thor/FloorPlan201/depth/0.npy", metres());
    let colors = RgbImage::from_fn(WIDTH, HEIGHT, |x, _| Rgb([if x < 4 { 1 } else { 4 }, 2, 3]));
    bench.file("thor/FloorPlan201/instance/0.png", png(&colors));
    bench.file(
        "thor/FloorPlan201/colors.json",
        "{\"(1, 2, 3)\": \"TVStand|-1.0|0.0|2.0\", \"(4, 2, 3)\": \"CoffeeTable|1|2|3\"}",
    );
    bench.file("home/x/images/a.png", png(&picture()));
    bench.file("home/x/depth/a.npy", metres());
    bench.file("home/x/masks/a.png", shallow(4, 9));
    bench.file("home/x/instances/a.png", deep(300, 0));
}

fn habitat(bench: &Bench) {
    let at = |name: &str| format!("habitat/00800-x/{name}");
    for i in 0..2 {
        bench.file(&at(&format!("rgb/00{i}.png")), png(&picture()));
        bench.file(&at(&format!("depth/00{i}.npy")), metres());
        let ids = npy("<i4", |x| if x < 4 { 3_i32 } else { 70_000 }.to_le_bytes());
        bench.file(&at(&format!("semantic/00{i}.npy")), ids);
    }
    bench.file(
        &at("x.semantic.txt"),
        "HM3D Semantic Annotations\n3,FF,\"bed, made\",0\n70000,AA,\"Kitchen cabinet\",1\n",
    );
    let step = |i: u32| {
        format!(
            "{{\"frame\":\"00{i}\",\"t\":{i},\"pose\":[1,0],\"intrinsics\":{{\"fx\":4,\"fy\":4,\"cx\":3.5,\"cy\":2.5}}}}\n"
        )
    };
    bench.file(&at("trajectory.jsonl"), step(0) + &step(1));
}

fn scannet(bench: &Bench) {
    let at = |name: &str| format!("scannet/scene0000_00/{name}");
    bench.file(
        "scannet/scannetv2-labels.combined.tsv",
        "id\traw_category\tcategory\tcount\tnyu40id\tmpcat40index\tmpcat40\n1\twall\twall\t9\t1\t1\twall\n1191\tcoffee table\ttable\t9\t7\t5\ttable\n",
    );
    bench.file(&at("color/0.jpg"), jpeg(&picture()));
    bench.file(&at("depth/0.png"), deep(1500, 2500));
    bench.file(&at("label-filt/0.png"), deep(1191, 1));
    bench.file(&at("instance-filt/0.png"), shallow(4, 0));
    bench.file(&at("pose/0.txt"), "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    bench.file(&at("scene0000_00.txt"), "axisAlignment = 1\nsceneType = Bedroom / Hotel\n");
    bench.file(&at("intrinsic/intrinsic_color.txt"), "4 0 3.5 0\n0 4 2.5 0\n0 0 1 0\n0 0 0 1\n");
}

fn sunrgbd(bench: &Bench) {
    let at = |name: &str| format!("sunrgbd/kv1/b3dodata/img_0063/{name}");
    bench.file(&at("image/img_0063.jpg"), jpeg(&picture()));
    let (near, far) = (2000_u16.rotate_left(3), 9000_u16.rotate_left(3));
    bench.file(&at("depth_bfx/img_0063.png"), deep(near, far));
    bench.file(&at("intrinsics.txt"), "500 0 3 0 510 2 0 0 1\n");
    bench.file(&at("scene.txt"), "living_room\n");
    bench.file(
        &at("annotation2Dfinal/index.json"),
        r#"{"frames":[{"polygon":[{"x":[0,8,8,0],"y":[0,0,6,6],"object":0},{"x":[-1,3.6,3.6,-1],"y":[-1,-1,9,9],"object":2},{"x":3,"y":2,"object":9}]}],"objects":[{"name":"wall"},null,{"name":"night_stand:2"}]}"#,
    );
}

fn picture() -> RgbImage {
    RgbImage::from_fn(WIDTH, HEIGHT, |x, y| Rgb([x as u8 * 20, y as u8 * 20, 90]))
}

/// A 16-bit map: `left` in the left half, `right` in the right.
fn deep(left: u16, right: u16) -> Vec<u8> {
    let map = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { left } else { right }]));
    map_file(&image::DynamicImage::ImageLuma16(map))
}

fn shallow(left: u8, right: u8) -> Vec<u8> {
    let map = GrayImage::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { left } else { right }]));
    map_file(&image::DynamicImage::ImageLuma8(map))
}

fn map_file(map: &image::DynamicImage) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    map.write_to(&mut file, ImageFormat::Png).unwrap();
    file.into_inner()
}

/// Depth in metres.
fn metres() -> Vec<u8> {
    npy("<f4", |x| if x < 4 { 2.0_f32 } else { 4.0 }.to_le_bytes())
}

/// An array as NumPy writes it.
fn npy(kind: &str, value: impl Fn(u32) -> [u8; 4]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({HEIGHT}, {WIDTH}), }}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.bytes());
    for place in 0..WIDTH * HEIGHT {
        file.extend(value(place % WIDTH));
    }
    file
}
