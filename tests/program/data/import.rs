//! `import`: every layout, written by the tests, becomes frames of the common interface.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::run::{Called, PROGRAM, called};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use darkqa_base::types::{DepthKind, Frame, FrameId};
use darkqa_eval::internals::dataset::{Dataset, open_frames};
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::Value;
use tempfile::TempDir;

const WIDTH: u32 = 8;
const HEIGHT: u32 = 6;

/// A folder to be imported, and the one it is imported to.
struct Scene(TempDir);

impl Scene {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        let path = self.0.path().join("src").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn text(&self, name: &str, text: &str) {
        fs::write(self.at(name), text).unwrap();
    }

    fn rgb(&self, name: &str) {
        RgbImage::from_fn(WIDTH, HEIGHT, |x, y| Rgb([x as u8 * 20, y as u8 * 20, 90])).save(self.at(name)).unwrap();
    }

    /// A 16-bit map: `left` in the left half, `right` in the right.
    fn deep(&self, name: &str, left: u16, right: u16) {
        let map = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { left } else { right }]));
        map.save(self.at(name)).unwrap();
    }

    fn shallow(&self, name: &str, left: u8, right: u8) {
        let map = GrayImage::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { left } else { right }]));
        map.save(self.at(name)).unwrap();
    }

    /// An array as NumPy writes it.
    fn npy<T: Copy>(&self, name: &str, descr: &str, left: T, right: T, bytes: fn(T) -> Vec<u8>) {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({HEIGHT}, {WIDTH}), }}\n");
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.bytes());
        for i in 0..WIDTH * HEIGHT {
            file.extend(bytes(if i % WIDTH < WIDTH / 2 { left } else { right }));
        }
        fs::write(self.at(name), file).unwrap();
    }

    fn metres(&self, name: &str, left: f32, right: f32) {
        self.npy(name, "<f4", left, right, |value| value.to_le_bytes().to_vec());
    }

    fn out(&self) -> PathBuf {
        self.0.path().join("out")
    }

    fn run(&self, kind: &str, flags: &[&str]) -> Called {
        called(
            Command::new(PROGRAM)
                .env_clear()
                .args(["import", kind, "--src"])
                .arg(self.0.path().join("src"))
                .arg("--out")
                .arg(self.out())
                .args(flags),
        )
    }

    /// Imports, and reads what came of it.
    fn import(&self, kind: &str, flags: &[&str]) -> Dataset {
        self.run(kind, flags).ended(0);
        open_frames(&self.out(), &[]).unwrap()
    }

    /// Imports in vain, and returns what is said.
    fn refused(&self, kind: &str, flags: &[&str]) -> String {
        let called = self.run(kind, flags);
        assert_ne!(called.code, Some(0), "{called:?}");
        called.stderr
    }

    fn line(&self, i: usize) -> Value {
        let text = fs::read_to_string(self.out().join("frames.jsonl")).unwrap();
        serde_json::from_str(text.lines().nth(i).unwrap()).unwrap()
    }
}

fn frame(set: &Dataset, name: &str) -> Frame {
    set.frame(&FrameId(name.into())).unwrap()
}

/// The values of a map on its left and right.
fn sides<T: Copy>(map: Option<&ndarray::Array2<T>>) -> (T, T) {
    let map = map.unwrap();
    (map[(0, 0)], map[(0, WIDTH as usize - 1)])
}

/// The canonical classes on the left and right.
fn classes(set: &Dataset, frame: &Frame) -> (String, String) {
    let (left, right) = sides(frame.semantic.as_ref());
    let labels = &set.labels().unwrap().labels;
    (labels[&left].canonical.clone(), labels[&right].canonical.clone())
}

fn pair(left: &str, right: &str) -> (String, String) {
    (left.into(), right.into())
}

/// One scene of habitat-sim.
fn habitat() -> Scene {
    let scene = Scene::new();
    for i in 0..5 {
        let name = |kind: &str, end: &str| format!("00800-x/{kind}/{i:03}.{end}");
        RgbaImage::from_pixel(WIDTH, HEIGHT, Rgba([9, 9, 9, 255])).save(scene.at(&name("rgb", "png"))).unwrap();
        scene.metres(&name("depth", "npy"), 2.0, f32::NAN);
        scene.npy(&name("semantic", "npy"), "<i4", 3_i32, 70_000, |value| value.to_le_bytes().to_vec());
    }
    scene.text(
        "00800-x/x.semantic.txt",
        "HM3D Semantic Annotations\n3,FF,\"bed, made\",0\n70000,AA,\"Kitchen cabinet\",1\n",
    );
    let steps = (0..5).map(|i| {
        format!("{{\"frame\":\"{i:03}\",\"t\":{},\"pose\":[1,0],\"intrinsics\":{{\"fx\":4,\"fy\":4,\"cx\":3.5,\"cy\":2.5}}}}\n", f64::from(i) * 0.9)
    });
    scene.text("00800-x/trajectory.jsonl", &steps.collect::<String>());
    scene
}

#[test]
fn habitat_renders_of_hm3d() {
    let scene = habitat();
    let message = scene.run("habitat", &["--every", "2"]).ended(0).stdout;
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/out: 2 frames of 1 scene, chosen from 5
    typical depth: 2.00 m
    without a class of mpcat40, taken as misc: "bed, made" 1
    "#);
    let set = open_frames(&scene.out(), &[]).unwrap();
    let names: Vec<&str> = set.frames().map(|id| id.0.as_str()).collect();
    assert_eq!(names, ["00800-x/000", "00800-x/003"]);
    let frame = frame(&set, "00800-x/003");
    assert_eq!(sides(frame.depth.as_ref()), (2000, 0));
    assert_eq!(sides(frame.segments.as_ref()), (3, 70_000));
    assert_eq!(classes(&set, &frame), pair("misc", "cabinet"));
    assert_eq!(frame.names[&70_000].name, "Kitchen cabinet");
    assert_eq!(frame.names[&3].region, Some(0));
    assert!((frame.intrinsics.unwrap().fx - 4.0).abs() < 1e-9);
    assert_eq!((scene.line(1)["t"].as_f64(), scene.line(1)["depth_scale"].as_f64()), (Some(2.7), Some(0.001)));
    assert_eq!(set.title(), "habitat");
}

#[test]
fn habitat_renders_of_matterport_and_replica() {
    let house = "R 0 0 0 0 b 0 0 0\nC 0 1 painting 39 objects 0\nC 1 1 bed 11 bed 0\nO 0 0 0 0 0 0\nO 1 0 1 0 0 0\n";
    let replica = r#"{"objects":[{"id":0,"class_name":"picture"},{"id":1,"class_name":"bed"}]}"#;
    let rows = [("m.house", house, Some("bedroom")), ("info_semantic.json", replica, None)];
    check_rows(rows, |(name, text, room)| {
        let scene = Scene::new();
        scene.rgb("s/rgb/0.png");
        scene.deep("s/depth/0.png", 2000, 3000);
        scene.deep("s/semantic/0.png", 0, 1);
        scene.text(&format!("s/{name}"), text);
        let set = scene.import("habitat", &["--depth-scale", "0.001", "--hfov", "90"]);
        let frame = frame(&set, "s/0");
        // An instance may have the number 0, which stands for none here.
        assert_eq!(sides(frame.segments.as_ref()), (1, 2), "{name}");
        assert_eq!(classes(&set, &frame), pair("picture", "bed"));
        assert_eq!(frame.room.as_deref(), room);
        let camera = frame.intrinsics.unwrap();
        assert!((camera.fx - 4.0).abs() < 1e-9 && (camera.cx - 3.5).abs() < 1e-9, "{camera:?}");
    });
}

#[cfg(unix)]
#[test]
fn links_out_of_the_data_set_are_refused() {
    let scene = habitat();
    let secret = scene.0.path().join("secret.png");
    fs::rename(scene.at("00800-x/rgb/000.png"), &secret).unwrap();
    std::os::unix::fs::symlink(&secret, scene.at("00800-x/rgb/000.png")).unwrap();
    insta::assert_snapshot!(redacted(&scene.refused("habitat", &[])), @"
    error: [TMP]/src/00800-x/rgb/000.png: leads out of [TMP]/src, the folder of the data; --data-root [TMP] allows
        the folder that it leads to
    ");
    let folder = scene.0.path().display().to_string();
    scene.import("habitat", &["--data-root", &folder]);
}

#[test]
fn faulty_render_labels_are_named() {
    let scene = habitat();
    fs::remove_file(scene.at("00800-x/x.semantic.txt")).unwrap();
    insta::assert_snapshot!(redacted(&scene.refused("habitat", &[])), @"
    error: [TMP]/src/00800-x: none of *.semantic.txt (HM3D-Sem), *.house (Matterport3D), info_semantic.json
        (Replica) in this folder; one of them must name the instances of the semantic maps
    ");
    scene.text("00800-x/x.semantic.txt", "HM3D Semantic Annotations\n9,FF,\"bed\",0\n");
    let message = scene.refused("habitat", &[]);
    insta::assert_snapshot!(redacted(&message), @"
    ERROR 00800-x/000: [TMP]/src/00800-x/semantic/000.npy: no pixel has the number of an instance that the scene
        names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json
    ERROR 00800-x/001: [TMP]/src/00800-x/semantic/001.npy: no pixel has the number of an instance that the scene
        names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json
    ERROR 00800-x/002: [TMP]/src/00800-x/semantic/002.npy: no pixel has the number of an instance that the scene
        names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json
    ERROR 00800-x/003: [TMP]/src/00800-x/semantic/003.npy: no pixel has the number of an instance that the scene
        names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json
    ERROR 00800-x/004: [TMP]/src/00800-x/semantic/004.npy: no pixel has the number of an instance that the scene
        names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json
    error: [TMP]/src: no frame of it could be read
    ");
    scene.text("00800-x/x.semantic.txt", "HM3D Semantic Annotations\n9,FF,bed,0\n");
    insta::assert_snapshot!(
        redacted(&scene.refused("habitat", &[])),
        @r#"error: [TMP]/src/00800-x/x.semantic.txt, line 2: a name between quotes expected in id,colour,"name",region"#
    );
}

#[test]
fn trajectory_must_fit_its_images() {
    let scene = habitat();
    let trajectory = "00800-x/trajectory.jsonl";
    scene.text(trajectory, "{\"frame\":\"000.png\"}\n{\"frame\":\"001.png\"}\n");
    let message = scene.run("habitat", &[]).ended(0).stderr;
    insta::assert_snapshot!(redacted(&message), @r#"
    WARN [TMP]/src/00800-x/trajectory.jsonl: frames without an image in rgb: 2, for example "000.png"; a frame
       has the name of its image, without the extension
    "#);
    scene.text(trajectory, "{\"frame\":\"000\"}\n{\"frame\":\"000\"}\n");
    insta::assert_snapshot!(
        redacted(&scene.refused("habitat", &["--force"])),
        @r#"error: [TMP]/src/00800-x/trajectory.jsonl, line 2: a second line of the frame "000""#
    );
}

#[test]
fn render_of_eight_bits_is_skipped() {
    let scene = habitat();
    scene.shallow("00800-x/semantic/001.png", 3, 3);
    fs::remove_file(scene.at("00800-x/semantic/001.npy")).unwrap();
    // 8 bits hold no numbers of instances; the other frames are taken.
    let message = scene.run("habitat", &[]).ended(1).stderr;
    insta::assert_snapshot!(redacted(&message), @"
    ERROR 00800-x/001: [TMP]/src/00800-x/semantic/001.png: a grey PNG of 8 bits; 16-bit grey expected, whose
        samples are the values themselves
    ");
    assert_eq!(open_frames(&scene.out(), &[]).unwrap().frames().count(), 4);
}

#[test]
fn existing_frames_need_force() {
    let scene = habitat();
    scene.run("habitat", &[]).ended(0);
    insta::assert_snapshot!(redacted(&scene.refused("habitat", &[])), @"
    error: [TMP]/out/frames.jsonl: the folder has frames already; --force overwrites them, another --out keeps
        both
    ");
    scene.run("habitat", &["--force", "--count", "2"]).ended(0);
    assert_eq!(open_frames(&scene.out(), &[]).unwrap().frames().count(), 2);
}

#[test]
fn frames_of_scannet() {
    let scene = Scene::new();
    scene.text(
        "scannetv2-labels.combined.tsv",
        "id\traw_category\tcategory\tcount\tnyu40id\tmpcat40index\tmpcat40\n1\twall\twall\t9\t1\t1\twall\n1191\tcoffee table\ttable\t9\t7\t5\ttable\n76\tpainting\tpicture\t1\t11\t39\tobjects\n31\tx\tx\t1\t1\t41\tunlabeled\n",
    );
    for i in [0, 30] {
        let name = |kind: &str, end: &str| format!("scene0000_00/{kind}/{i}.{end}");
        scene.rgb(&name("color", "jpg"));
        // Half the size of colour.
        let deep =
            ImageBuffer::from_fn(WIDTH / 2, HEIGHT / 2, |x, _| Luma([if x < WIDTH / 4 { 1500_u16 } else { 2500 }]));
        deep.save(scene.at(&name("depth", "png"))).unwrap();
        scene.deep(&name("label-filt", "png"), 1191, 76);
        scene.shallow(&name("instance-filt", "png"), 4, 0);
        scene
            .text(&name("pose", "txt"), if i == 0 { "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1" } else { "-inf -inf -inf -inf" });
    }
    scene.text("scene0000_00/scene0000_00.txt", "axisAlignment = 1\nsceneType = Bedroom / Hotel\n");
    scene.text("scene0000_00/intrinsic/intrinsic_color.txt", "4 0 3.5 0\n0 4 2.5 0\n0 0 1 0\n0 0 0 1\n");
    let set = scene.import("scannet", &[]);
    let frame = frame(&set, "scene0000_00/0");
    assert_eq!(set.frames().count(), 1);
    assert_eq!(sides(frame.depth.as_ref()), (1500, 2500));
    assert_eq!(classes(&set, &frame), pair("table", "picture"));
    assert_eq!(set.labels().unwrap().labels[&1191].name, "coffee table");
    assert!(set.labels().unwrap().void.contains(&31));
    let (left, right) = sides(frame.segments.as_ref());
    assert!(left > 0 && right == 0);
    assert_eq!(frame.room.as_deref(), Some("bedroom"));
    assert!((frame.intrinsics.unwrap().cy - 2.5).abs() < 1e-9);

    let groups = vec!["{}"; 256].join(",");
    scene.text("scene0000_00/scene0000_00.aggregation.json", &format!("{{\"segGroups\":[{groups}]}}"));
    let message = scene.refused("scannet", &["--force"]);
    insta::assert_snapshot!(redacted(&message), @"
    error: [TMP]/src/scene0000_00/scene0000_00.aggregation.json: 256 objects, but the 8 bits of instance-filt hold
        255: their numbers overflow; export them with 16 bits, as in frames_25k
    ");
}

#[test]
fn frames_of_scannet_25k() {
    let scene = Scene::new();
    scene.rgb("scene0001_00/color/000100.jpg");
    scene.deep("scene0001_00/depth/000100.png", 1500, 0);
    scene.shallow("scene0001_00/label/000100.png", 5, 0);
    scene.deep("scene0001_00/instance/000100.png", 5002, 0);
    let set = scene.import("scannet", &[]);
    let frame = frame(&set, "scene0001_00/000100");
    assert_eq!(sides(frame.semantic.as_ref()), (5, 0));
    assert_eq!(set.labels().unwrap().space, "nyu40");
    assert_eq!((frame.segments.unwrap()[(0, 0)], scene.line(0)["t"].as_f64()), (1, Some(100.0 / 30.0)));
}

#[test]
fn images_and_maps_of_nyu() {
    let scene = Scene::new();
    scene.rgb("rgb/00001.png");
    scene.deep("depth/00001.png", 10_000, 15_000);
    scene.shallow("labels/00001.png", 3, 255);
    let message = scene.refused("nyu", &["--labels", "nyu40-1"]);
    insta::assert_snapshot!(redacted(&message), @"
    ERROR src/00001: [TMP]/src/depth/00001.png: depth_scale is missing: the metres in one unit of the depth PNG,
        as 0.001 (--depth-scale METRES sets it)
    error: [TMP]/src: no frame of it could be read
    ");
    let set = scene.import("nyu", &["--labels", "nyu40-1", "--depth-scale", "0.0002"]);
    let frame = frame(&set, "src/00001");
    assert_eq!(sides(frame.depth.as_ref()), (2000, 3000));
    assert_eq!(sides(frame.semantic.as_ref()), (4, 0));
    assert!(frame.intrinsics.is_none(), "the camera is that of 640 × 480");
    let message = scene.refused("nyu", &["--force", "--depth-scale", "0.00001"]);
    insta::assert_snapshot!(redacted(&message), @"
    error: depth: the typical depth of the frames is 0.1 m, but that of rooms is between 0.3 and 15 m; set
        --depth-scale to the metres per unit of depth
    ");
    let message = scene.refused("nyu", &["--force", "--depth-scale", "1"]);
    insta::assert_snapshot!(redacted(&message), @"
    ERROR src/00001: [TMP]/src/depth/00001.png: a depth of 10000 m, deeper than any room (1000 m at most); a .npy
        file is in metres and a PNG in units of its depth_scale, with 0 where there is no depth
    error: [TMP]/src: no frame of it could be read
    ");
}

#[test]
fn frames_of_sun_rgb_d() {
    let scene = Scene::new();
    let at = |name: &str| format!("kv1/b3dodata/img_0063/{name}");
    scene.rgb(&at("image/img_0063.jpg"));
    // 2000 mm and 9000 mm, rotated left by three bits.
    scene.deep(&at("depth_bfx/img_0063.png"), 2000_u16.rotate_left(3), 9000_u16.rotate_left(3));
    // The depth before holes were filled, under the same name: it is not the one that is read.
    scene.deep(&at("depth/img_0063.png"), 1000_u16.rotate_left(3), 1000_u16.rotate_left(3));
    scene.text(&at("intrinsics.txt"), "500 0 3 0 510 2 0 0 1\n");
    scene.text(&at("scene.txt"), "living_room\n");
    scene.text(
        &at("annotation2Dfinal/index.json"),
        r#"{"frames":[{"polygon":[{"x":[0,8,8,0],"y":[0,0,6,6],"object":0},{"x":[-1,3.6,3.6,-1],"y":[-1,-1,9,9],"object":2},{"x":3,"y":2,"object":9}]}],"objects":[{"name":"wall"},null,{"name":"night_stand:2"}]}"#,
    );
    let set = scene.import("sunrgbd", &[]);
    let frame = frame(&set, "kv1-b3dodata/img_0063");
    assert_eq!(sides(frame.depth.as_ref()), (2000, 8000));
    // Which of the two was read is said, by frame and in all.
    assert_eq!(scene.line(0)["depth_from"], "depth_bfx");
    let out = scene.run("sunrgbd", &["--force"]).ended(0).stdout;
    insta::assert_snapshot!(redacted(&out), @"
    [TMP]/out: 1 frame of 1 scene
    typical depth: 2.00 m
    frames by the folder of their depth: depth_bfx 1
    not read: kv1/b3dodata/img_0063/depth/img_0063.png
    ");
    assert_eq!(sides(frame.segments.as_ref()), (3, 1));
    assert_eq!(classes(&set, &frame), pair("chest_of_drawers", "wall"));
    assert_eq!(frame.room.as_deref(), Some("living room"));
    assert!((frame.intrinsics.unwrap().fy - 510.0).abs() < 1e-9);
    // Without filled depth, the other one is read, and that is said too.
    fs::remove_file(scene.at(&at("depth_bfx/img_0063.png"))).unwrap();
    let set = scene.import("sunrgbd", &["--force"]);
    let unfilled = self::frame(&set, "kv1-b3dodata/img_0063");
    assert_eq!(sides(unfilled.depth.as_ref()), (1000, 1000));
    assert_eq!(scene.line(0)["depth_from"], "depth");
}

#[test]
fn dumps_of_ai2_thor() {
    let scene = Scene::new();
    scene.rgb("FloorPlan201/rgb/0.png");
    scene.metres("FloorPlan201/depth/0.npy", 1.25, 3.0);
    let colors = RgbImage::from_fn(WIDTH, HEIGHT, |x, _| if x < 4 { Rgb([1, 2, 3]) } else { Rgb([4, 5, 6]) });
    colors.save(scene.at("FloorPlan201/instance/0.png")).unwrap();
    scene
        .text("FloorPlan201/colors.json", r#"{"(1, 2, 3)": "TVStand|-1.0|0.0|2.0", "(4, 5, 6)": "CoffeeTable|1|2|3"}"#);
    let set = scene.import("thor", &["--hfov", "90"]);
    let frame = frame(&set, "FloorPlan201/0");
    assert_eq!(sides(frame.depth.as_ref()), (1250, 3000));
    assert_eq!(classes(&set, &frame), pair("furniture", "table"));
    let (_, right) = sides(frame.segments.as_ref());
    assert_eq!((frame.names[&right].name.as_str(), frame.room.as_deref()), ("coffee table", Some("living room")));
    scene.text("FloorPlan201/colors.json", r#"{"red": "Bed|1"}"#);
    insta::assert_snapshot!(
        redacted(&scene.refused("thor", &["--force"])),
        @r#"error: [TMP]/src/FloorPlan201/colors.json: "red" is not a colour; three numbers expected, as in "(12, 34, 56)""#
    );
}

#[test]
fn folders_of_images_and_maps() {
    let scene = Scene::new();
    scene.rgb("home/images/a.png");
    scene.metres("home/depth/a.npy", 2.0, 4.0);
    scene.shallow("home/masks/a.png", 4, 9);
    scene.deep("home/instances/a.png", 300, 0);
    insta::assert_snapshot!(redacted(&scene.refused("folder", &[])), @"
    error: --labels: the label space of the class maps is missing; nyu40, nyu13, mpcat40, ade150 or the path of a
        classes.json expected
    ");
    insta::assert_snapshot!(redacted(&scene.refused("folder", &["--labels", "klingon"])), @r#"
    error: --labels: "klingon" is neither a file nor one of the built-in label spaces: ade150, mpcat40, nyu13,
        nyu40
    "#);
    let set = scene.import("folder", &["--labels", "nyu40", "--depth-kind", "euclid", "--name", "mine"]);
    let found = frame(&set, "home/a");
    assert_eq!((set.title(), found.depth_kind), ("mine", DepthKind::Euclid));
    assert_eq!(sides(found.segments.as_ref()), (300, 0));
    // What was imported can be imported again, as for its key frames.
    let again = scene.0.path().join("again");
    called(
        Command::new(PROGRAM)
            .args(["import", "folder", "--count", "1", "--src"])
            .arg(scene.out())
            .arg("--out")
            .arg(&again),
    )
    .ended(0);
    let twice = frame(&open_frames(&again, &[]).unwrap(), "home/a");
    assert_eq!((twice.depth, twice.semantic, twice.segments), (found.depth, found.semantic, found.segments));
    assert_eq!(twice.rgb, found.rgb);
}

/// A folder of two frames with depth of 0..1, and no other maps.
fn normalised_depth(far: f32) -> Scene {
    let scene = Scene::new();
    for number in 0..2 {
        scene.rgb(&format!("home/rgb/{number}.png"));
        scene.metres(&format!("home/depth/{number}.npy"), 0.35, far);
    }
    scene
}

#[test]
fn depth_of_0_to_1_needs_its_unit() {
    let scene = normalised_depth(1.0);
    insta::assert_snapshot!(redacted(&scene.refused("folder", &["--labels", "nyu40"])), @"
    error: depth: all values are in 0..1 (the greatest is 1): depth normalised to the range of its sensor, as
        habitat-lab gives it by default (normalize_depth), or metres; state the metres of the value 1, for example
        --depth-scale 10 for habitat-lab's default of max_depth, or --depth-scale 1 for metres
    ");
    for (scale, sides_of_map) in [("10", (3_500, 10_000)), ("1", (350, 1_000))] {
        let flags = ["--labels", "nyu40", "--force", "--depth-scale", scale];
        let set = scene.import("folder", &flags);
        assert_eq!(sides(frame(&set, "home/0").depth.as_ref()), sides_of_map);
    }
    // One value above 1 shows metres.
    let scene = normalised_depth(1.2);
    let metres = scene.import("folder", &["--labels", "nyu40"]);
    assert_eq!(sides(frame(&metres, "home/0").depth.as_ref()), (350, 1_200));
}

#[test]
fn integers_in_arrays_of_depth_need_their_unit() {
    let scene = Scene::new();
    scene.rgb("home/rgb/0.png");
    let bytes = |value: u16| value.to_le_bytes().to_vec();
    scene.npy("home/depth/0.npy", "<u2", 2_000, 3_000, bytes);
    insta::assert_snapshot!(redacted(&scene.refused("folder", &["--labels", "nyu40"])), @"
    ERROR home/0: [TMP]/src/home/depth/0.npy: it holds integers; floats of 2, 4 or 8 bytes expected, or the metres
        per unit: --depth-scale METRES
    error: [TMP]/src: no frame of it could be read
    ");
    let set = scene.import("folder", &["--labels", "nyu40", "--depth-scale", "0.001"]);
    assert_eq!(sides(frame(&set, "home/0").depth.as_ref()), (2_000, 3_000));
}

#[test]
fn array_class_maps_are_read() {
    let scene = Scene::new();
    for number in 0..3 {
        scene.rgb(&format!("home/rgb/{number}.png"));
        // Hypersim has −1 for no class.
        scene.npy(&format!("home/sem/{number}.npy"), "<i2", 4_i16, -1, |value| value.to_le_bytes().to_vec());
        scene.npy(&format!("home/depth/{number}.npy"), "<f2", 0x4000_u16, 0x4400, |value| value.to_le_bytes().to_vec());
        scene.text(&format!("home/normals/{number}.exr"), "");
    }
    scene.text("home/notes", "");
    let called = scene.run("folder", &["--labels", "nyu40", "--count", "2"]).ended(0);
    let said = called.stdout;
    insta::assert_snapshot!(redacted(&said), @"
    [TMP]/out: 2 frames of 1 scene, chosen from 3
    typical depth: 2.00 m
    not read: 3 normals/*.exr, home/notes
    ");
    let set = open_frames(&scene.out(), &[]).unwrap();
    let found = frame(&set, "home/0");
    assert_eq!(sides(found.semantic.as_ref()), (4, 0));
    assert_eq!(sides(found.depth.as_ref()), (2_000, 4_000));
    scene.npy("home/sem/0.npy", "<i4", 70_000_i32, 0, |value| value.to_le_bytes().to_vec());
    let refused = scene.refused("folder", &["--labels", "nyu40", "--force"]);
    insta::assert_snapshot!(redacted(&refused), @"ERROR home/0: [TMP]/src/home/sem/0.npy: 70000 is too large for the number of a class");
}

#[test]
fn hypersim_maps_in_hdf5_are_read() {
    let scene = Scene::new();
    let images = "ai_001_002/images/scene_cam_01";
    scene.rgb("image.png");
    for number in ["0003", "0007"] {
        let image = scene.at(&format!("{images}_final_preview/frame.{number}.tonemap.jpg"));
        let picture = image::open(scene.at("image.png")).unwrap().into_rgb8();
        picture.save(image).unwrap();
        let map = |name: &str| scene.at(&format!("{images}_geometry_hdf5/frame.{number}.{name}.hdf5"));
        let sides = |left: u16, right: u16| -> Vec<u8> {
            let row: Vec<u8> =
                (0..WIDTH).map(|x| if x < WIDTH / 2 { left } else { right }).flat_map(u16::to_le_bytes).collect();
            row.repeat(HEIGHT as usize)
        };
        let size = [u64::from(HEIGHT), u64::from(WIDTH)];
        // 2.0 and 4.0 as 16-bit floats; classes and instances of −1 are none.
        fs::write(map("depth_meters"), hdf5(1, 0, size, &sides(0x4000, 0x4400))).unwrap();
        fs::write(map("semantic"), hdf5(0, 8, size, &sides(4, u16::MAX))).unwrap();
        fs::write(map("semantic_instance"), hdf5(0, 8, size, &sides(7, u16::MAX))).unwrap();
        fs::write(map("world_normal"), "").unwrap();
    }
    let called = scene.run("hypersim", &[]).ended(0);
    let said = called.stdout;
    insta::assert_snapshot!(redacted(&said), @"
    [TMP]/out: 2 frames of 1 scene
    typical depth: 2.00 m
    not read: 2 scene_cam_01_geometry_hdf5/*.hdf5, image.png
    ");
    let set = open_frames(&scene.out(), &[]).unwrap();
    let found = frame(&set, "ai_001_002/cam_01-0003");
    assert_eq!(found.depth_kind, DepthKind::Euclid);
    assert_eq!(sides(found.depth.as_ref()), (2_000, 4_000));
    assert_eq!(sides(found.semantic.as_ref()), (4, 0));
    assert_eq!(sides(found.segments.as_ref()), (7, 0));
}

/// An HDF5 file of one array of 16-bit numbers, as h5py writes it without compression: a class of type, its bits, and
/// the numbers.
fn hdf5(class: u8, bits: u8, size: [u64; 2], data: &[u8]) -> Vec<u8> {
    let long = |numbers: &[u64]| -> Vec<u8> { numbers.iter().flat_map(|number| number.to_le_bytes()).collect() };
    let header = |messages: &[(u16, Vec<u8>)]| {
        let mut body = Vec::new();
        for (kind, data) in messages {
            let whole = data.len().next_multiple_of(8);
            body.extend(kind.to_le_bytes());
            body.extend((whole as u16).to_le_bytes());
            body.extend([0; 4]);
            body.extend(data);
            body.extend(vec![0; whole - data.len()]);
        }
        let mut header = vec![1, 0, messages.len() as u8, 0, 1, 0, 0, 0];
        header.extend(long(&[body.len() as u64]));
        header.extend(body);
        header
    };
    let mut file = b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0\x04\0\x10\0\0\0\0\0".to_vec();
    // The root group is at 96, its tree at 136, its node at 184, its names at 232 and 264, the array at 288, its
    // numbers at 400.
    file.extend(long(&[0, u64::MAX, 400 + data.len() as u64, u64::MAX, 0, 96, 0, 0, 0]));
    file.extend(header(&[(17, long(&[136, 232]))]));
    file.extend(b"TREE\0\0\x01\0");
    file.extend(long(&[u64::MAX, u64::MAX, 0, 184, 8]));
    file.extend(b"SNOD\x01\0\x01\0");
    file.extend(long(&[8, 288, 0, 0, 0]));
    file.extend(b"HEAP\0\0\0\0");
    file.extend(long(&[24, u64::MAX, 264]));
    file.extend(b"\0\0\0\0\0\0\0\0dataset\0\0\0\0\0\0\0\0\0");
    let dataspace = [vec![1, 2, 0, 0, 0, 0, 0, 0], long(&size)].concat();
    let datatype = vec![16 | class, bits, 0, 0, 2, 0, 0, 0];
    let layout = [vec![3, 1], long(&[400, data.len() as u64])].concat();
    file.extend(header(&[(1, dataspace), (3, datatype), (8, layout)]));
    file.resize(400, 0);
    file.extend(data);
    file
}

#[test]
fn folder_without_class_maps_says_so() {
    let scene = Scene::new();
    scene.rgb("rgb/0.png");
    let called = scene.run("folder", &["--labels", "nyu40"]).ended(0);
    let said = called.stdout;
    insta::assert_snapshot!(redacted(&said), @"
    [TMP]/out: 1 frame of 1 scene
    no depth: there will be no questions about the closest object
    no class maps: there will be no questions by rule
    ");
}

#[test]
fn folders_join_with_distinct_scenes() {
    let scene = Scene::new();
    for (folder, class) in [("one", 4), ("two", 5)] {
        scene.rgb(&format!("{folder}/home/rgb/0.png"));
        scene.shallow(&format!("{folder}/home/sem/0.png"), class, 9);
        scene.rgb(&format!("{folder}/only-{folder}/rgb/0.png"));
        scene.shallow(&format!("{folder}/only-{folder}/sem/0.png"), class, 9);
    }
    let import = |labels: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(["import", "folder", "--labels", labels, "--src"]);
        command.arg(scene.0.path().join("src/one")).arg("--src");
        command.arg(scene.0.path().join("src/two")).arg("--out").arg(scene.out());
        called(&mut command).ended(0)
    };
    import("nyu40");
    let set = open_frames(&scene.out(), &[]).unwrap();
    let names: Vec<&str> = set.frames().map(|frame| frame.0.as_str()).collect();
    assert_eq!(names, ["1-home/0", "2-home/0", "only-one/0", "only-two/0"]);
    assert_eq!(sides(frame(&set, "1-home/0").semantic.as_ref()), (4, 9));
    assert_eq!(sides(frame(&set, "2-home/0").semantic.as_ref()), (5, 9));
    // Questions name the command that joins.
    let said = called(Command::new(PROGRAM).args(["questions", "one", "two", "--out", "q.jsonl"])).ended(2).stderr;
    insta::assert_snapshot!(redacted(&said), @"
    error: DATA: one folder expected, which a run takes with its questions; darkqa-eval import folder --src one
        --src two --out JOINED makes one of 2
    ");
}

#[test]
fn broken_folders_are_named() {
    let scene = Scene::new();
    scene.rgb("rgb/a.png");
    scene.shallow("sem/b.png", 1, 2);
    let flags = ["--labels", "nyu40"];
    insta::assert_snapshot!(redacted(&scene.refused("folder", &flags)), @"error: [TMP]/src/sem/b.png: no image has the name of this map");
    fs::remove_file(scene.at("sem/b.png")).unwrap();
    let small = GrayImage::new(3, 3);
    small.save(scene.at("sem/a.png")).unwrap();
    let message = scene.refused("folder", &flags);
    insta::assert_snapshot!(redacted(&message), @"
    ERROR src/a: [TMP]/src/sem/a.png: 3 × 3 pixels (height × width), but its image has 6 × 8; maps of labels are
        never scaled
    error: [TMP]/src: no frame of it could be read
    ");
    insta::assert_snapshot!(redacted(&Scene::new().refused("habitat", &[])), @"error: --src: [TMP]/src: no such folder");
    insta::assert_snapshot!(redacted(&scene.refused("habitat", &[])), @"
    error: [TMP]/src: no frames of habitat in this folder; see the layouts:
        https://github.com/darkqa-eval/darkqa-eval/blob/main/src/docs/importing.md
    ");
    insta::assert_snapshot!(redacted(&scene.refused("lego", &[])), @"
    error: invalid value 'lego' for '<KIND>' [possible values: habitat, scannet, nyu, sunrgbd, thor, hypersim,
        folder]
    ");
    insta::assert_snapshot!(redacted(&scene.refused("folder", &["--labels", "nyu40", "--every", "2", "--force"])), @"
    error: --every: the frame src/a has no time; state the frames per second with --fps, or use --count N, which
        needs no time
    ");
    assert!(!Path::new(&scene.out().join("frames.jsonl")).exists());
}
