//! Pieces described by a table: [`piece`] makes one by its name, [`names_found_at`] lists names by place.
//!
//! `parts.txt` describes small objects, lamps and other furniture of a fixed form. A new object needs only a few lines
//! of text; the head of the table documents the format.

use std::sync::LazyLock;

use glam::{Vec3, vec3};

use super::super::mesh::Mesh;
use super::super::pattern::Pattern;
use super::super::seeded_rng::SeededRng;
use crate::mesh::{LightSource, Piece, ThingKind};
use crate::pattern::{self, ALL_COLORS, Paint, Surface, SurfaceFinish, linear_rgb};

const TABLE: &str = include_str!("parts.txt");

/// Entries of the table; empty if a line cannot be parsed, which a test rules out.
static RECIPES: LazyLock<Vec<PartEntry>> = LazyLock::new(|| parse(TABLE).unwrap_or_default());

/// Colour of warm light for a camera that is white-balanced for daylight.
const WARM: Vec3 = Vec3::new(1.0, 0.94, 0.85);

/// An entry of the table.
#[derive(Debug)]
struct PartEntry {
    /// Name in the table, which distinguishes variants of a thing: `sink:2`.
    name: &'static str,
    kind: ThingKind,
    /// Places where such a thing is found, such as `floor`.
    places: Vec<&'static str>,
    /// Minimum and maximum factor by which the size is scaled.
    scale: [f32; 2],
    /// Possible main colours: names of paints or hexadecimal sRGB codes. Any colour if empty.
    colors: Vec<&'static str>,
    solids: Vec<Solid>,
}

/// A solid of a piece: one line of the table.
#[derive(Debug)]
struct Solid {
    copies: Copies,
    shape: &'static str,
    surface: &'static str,
    numbers: Vec<f32>,
}

/// Number and placement of the copies of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Copies {
    One,
    /// Also at −x.
    Mirrored,
    /// This many, evenly around a vertical axis at x and z; the coordinates of the solid are relative to the axis.
    Around(usize, [f32; 2]),
}

/// Parses a table.
///
/// # Errors
/// The first line that cannot be parsed.
fn parse(table: &'static str) -> Result<Vec<PartEntry>, &'static str> {
    let mut recipes: Vec<PartEntry> = Vec::new();
    for line in table.lines().filter(|line| !line.starts_with('#')).filter(|line| !line.trim().is_empty()) {
        if line.starts_with('[') {
            recipes.push(parse_head(line).ok_or(line)?);
        } else {
            let solid = parse_solid(line).filter(Solid::is_valid).ok_or(line)?;
            recipes.last_mut().ok_or(line)?.solids.push(solid);
        }
    }
    Ok(recipes)
}

/// Parses the first line of an entry.
fn parse_head(line: &'static str) -> Option<PartEntry> {
    let (name, rest) = line.strip_prefix('[')?.split_once(']')?;
    let (word, _) = name.split_once(':').unwrap_or((name, ""));
    let mut cells = rest.split('|').map(|cell| cell.split_whitespace());
    let class = cells.next()?.next()?;
    let places = cells.next()?.collect();
    let mut scale = cells.next()?.map(|number| number.parse().ok());
    Some(PartEntry {
        name,
        kind: ThingKind { word, class },
        places,
        scale: [scale.next()??, scale.next()??],
        colors: cells.next()?.collect(),
        solids: Vec::new(),
    })
}

/// Parses any other line of an entry.
fn parse_solid(line: &'static str) -> Option<Solid> {
    let mut words = line.split_whitespace().peekable();
    let copies = match words.next_if(|word| word.starts_with('*')) {
        None => Copies::One,
        Some("*mirrored") => Copies::Mirrored,
        Some(around) => {
            let (count, axis) = around.strip_prefix('*')?.split_once('@')?;
            let (x, z) = axis.split_once(',')?;
            Copies::Around(count.parse().ok()?, [x.parse().ok()?, z.parse().ok()?])
        }
    };
    Some(Solid {
        copies,
        shape: words.next()?,
        surface: words.next()?,
        numbers: words.map(|number| number.parse().ok()).collect::<Option<_>>()?,
    })
}

impl Solid {
    /// True if shape and numbers are valid.
    fn is_valid(&self) -> bool {
        let surface = Surface::plain([128, 128, 128]);
        self.shape == "light" && self.numbers.len() == 5 || self.add_to(&mut Mesh::default(), &surface).is_some()
    }

    /// Adds the solid to a mesh; `None` if its shape is unknown or its numbers do not fit the shape.
    fn add_to(&self, mesh: &mut Mesh, surface: &Surface) -> Option<()> {
        let point = Vec3::from_slice;
        match (self.shape, &self.numbers[..]) {
            ("box", &[x, to_x, y, to_y, z, to_z]) => {
                mesh.block(vec3(x, y, z), vec3(to_x, to_y, to_z), surface);
            }
            ("soft", &[radius, x, to_x, y, to_y, z, to_z]) => {
                mesh.rounded_box(vec3(x, y, z), vec3(to_x, to_y, to_z), radius, surface);
            }
            ("rod", [radius, ends @ ..]) if ends.len() == 6 => {
                mesh.rod(point(ends), point(&ends[3..]), *radius, surface);
            }
            ("cone", [from, to, ends @ ..]) if ends.len() == 6 => {
                mesh.cone(point(ends), point(&ends[3..]), [*from, *to], surface);
            }
            ("ball", at) if at.len() == 6 => mesh.ball(point(at), point(&at[3..]), surface),
            ("lathe", [x, y, z, depth, profile @ ..]) if profile.len() >= 4 => {
                mesh.lathe(vec3(*x, *y, *z), &pairs(profile), *depth, surface);
            }
            ("turn", [x, y, z, depth, profile @ ..]) if profile.len() >= 4 => {
                mesh.smooth_lathe(vec3(*x, *y, *z), &pairs(profile), *depth, surface);
            }
            _ => return None,
        }
        Some(())
    }

    /// Adds all copies of the solid to a mesh.
    fn add_all_to(&self, mesh: &mut Mesh, surface: &Surface) {
        let mut one = Mesh::default();
        self.add_to(&mut one, surface);
        match self.copies {
            Copies::One => mesh.add(&one, Vec3::ZERO, 0.0),
            Copies::Mirrored => {
                mesh.add(&one, Vec3::ZERO, 0.0);
                mesh.add(&one.mirrored(), Vec3::ZERO, 0.0);
            }
            Copies::Around(count, [x, z]) => {
                for turn in 0..count {
                    let angle = std::f32::consts::TAU * turn as f32 / count as f32;
                    mesh.add(&one, vec3(x, 0.0, z), angle);
                }
            }
        }
    }
}

fn pairs(numbers: &[f32]) -> Vec<(f32, f32)> {
    numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Returns the paint for a colour of the table: a name or a hexadecimal code.
fn parse_paint(word: &str, rng: &mut SeededRng) -> Paint {
    let number = u32::from_str_radix(word, 16).ok();
    match number.filter(|_| word.len() == 6) {
        Some(number) => Paint::nameless(pattern::codes_from_hex(number)),
        None => Paint::random(&[word], rng),
    }
}

/// Returns the surface for a word of the table: a colour, followed by a sign for the material.
fn parse_surface(word: &str, main: Paint, rng: &mut SeededRng) -> Surface {
    let color = word.trim_end_matches(['+', '~', '=', '/', '^', '%']);
    let paint = match color {
        "steel" => return Surface::steel(),
        "shade" => {
            return Surface {
                color: linear_rgb([255, 238, 206]),
                pattern: Pattern::Plain,
                finish: SurfaceFinish::Glow(1.6),
            };
        }
        "flame" => {
            return Surface {
                color: linear_rgb([255, 168, 60]),
                pattern: Pattern::Plain,
                finish: SurfaceFinish::Glow(1.1),
            };
        }
        "main" => main,
        "any" => Paint::random(&ALL_COLORS, rng),
        color => parse_paint(color, rng),
    };
    match &word[color.len()..] {
        "+" => Surface::gloss(paint),
        "~" => Surface::cloth(paint),
        "=" => Surface::wood(paint, 0),
        "/" => Surface::wood(paint, 1),
        "^" => Surface::paint(paint).with_pattern(Pattern::Pile),
        "%" => Surface::paint(paint).with_pattern(Pattern::Tiles([0.24, 0.08], linear_rgb([186, 180, 170]))),
        _ => Surface::paint(paint),
    }
}

/// Makes the piece of a name, with a random size in one of its colours. Empty for a name that is not in the table.
pub(crate) fn piece(name: &str, rng: &mut SeededRng) -> Piece {
    let color = match find(name).map(|recipe| &recipe.colors[..]) {
        Some([]) => rng.pick(&ALL_COLORS),
        Some(colors) => rng.pick(colors),
        None => "",
    };
    let main = parse_paint(color, rng);
    piece_in_paint(name, main, rng)
}

fn find(name: &str) -> Option<&'static PartEntry> {
    RECIPES.iter().find(|recipe| recipe.name == name)
}

/// Makes the piece of a name, with a random size in this paint.
pub(crate) fn piece_in_paint(name: &str, main: Paint, rng: &mut SeededRng) -> Piece {
    let mut mesh = Mesh::default();
    let Some(recipe) = find(name) else {
        let nothing = ThingKind { word: "", class: "objects" };
        return Piece::new(nothing, mesh, "");
    };
    let scale = rng.between(recipe.scale[0], recipe.scale[1]);
    let mut light = None;
    for solid in &recipe.solids {
        match (solid.shape, &solid.numbers[..]) {
            ("light", &[x, y, z, radius, strength]) => {
                light = Some(LightSource::Bulb { middle: vec3(x, y, z) * scale, radius, radiance: WARM * strength });
            }
            _ => solid.add_all_to(&mut mesh, &parse_surface(solid.surface, main, rng)),
        }
    }
    mesh.scale(scale);
    let mut piece = Piece::new(recipe.kind, mesh, main.name);
    piece.light = light;
    piece
}

/// Names of the things that are found at a place, such as `floor`.
pub(crate) fn names_found_at(place: &str) -> Vec<&'static str> {
    RECIPES.iter().filter(|recipe| recipe.places.contains(&place)).map(|recipe| recipe.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_read() {
        assert_eq!(parse(TABLE).err(), None);
        let names: Vec<&str> = RECIPES.iter().map(|recipe| recipe.name).collect();
        for (index, name) in names.iter().enumerate() {
            assert!(!names[..index].contains(name), "{name} is there twice");
            let made = piece(name, &mut SeededRng::new(1, &[name]));
            assert!(made.mesh.faces.len() > 1, "{name}");
        }
    }

    #[test]
    fn invalid_line_is_the_error() {
        let head = "[x] objects | floor | 1 1 | red\n";
        for line in ["box main 1 2 3", "bax main 0 1 0 1 0 1", "*x box main 0 1 0 1 0 1"] {
            let table: &'static str = format!("{head}{line}").leak();
            assert_eq!(parse(table).err(), Some(line));
        }
        assert!(parse("[x] objects | floor | one | red").is_err());
    }
}
