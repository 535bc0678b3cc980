//! Pieces that a table describes: [`piece`], by name, and [`found`], by the place where such things are found.
//!
//! `parts.txt` lists small objects, lamps and other furniture of a fixed form; a new object is a few lines of text. The head of the table
//! documents the format.

use std::sync::LazyLock;

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::Mesh;
use super::super::paint::{self, ALL, Paint, rgb};
use super::super::pattern::Pattern;
use super::super::scene::{LightSource, Piece, ThingKind};
use super::super::surface::{Surface, SurfaceFinish};

const TABLE: &str = include_str!("parts.txt");

/// The entries of the table; none if a line of it cannot be read, which a test rules out.
static RECIPES: LazyLock<Vec<Recipe>> = LazyLock::new(|| read(TABLE).unwrap_or_default());

/// The colour of warm light, as a camera that is white-balanced for daylight sees it.
const WARM: Vec3 = Vec3::new(1.0, 0.94, 0.85);

/// An entry of the table.
#[derive(Debug)]
struct Recipe {
    /// The name in the table, which tells apart things of one word.
    name: &'static str,
    kind: ThingKind,
    /// The places where such a thing is found, as `floor`.
    places: Vec<&'static str>,
    /// The least and the greatest factor that its size is multiplied by.
    scale: [f32; 2],
    /// The main colours that it may have: names of paints, or sRGB codes in hexadecimal digits.
    colors: Vec<&'static str>,
    parts: Vec<Solid>,
}

/// A solid of a piece, as its line has it.
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
    /// This many, evenly around a vertical axis at x and z; the solid is given as seen from the axis.
    Around(usize, [f32; 2]),
}

/// The entries of a table; the line that cannot be read if there is one.
fn read(table: &'static str) -> Result<Vec<Recipe>, &'static str> {
    let mut recipes: Vec<Recipe> = Vec::new();
    for line in table
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter(|line| !line.trim().is_empty())
    {
        if line.starts_with('[') {
            recipes.push(head(line).ok_or(line)?);
        } else {
            let part = part(line).filter(Solid::is_known).ok_or(line)?;
            recipes.last_mut().ok_or(line)?.parts.push(part);
        }
    }
    Ok(recipes)
}

/// The first line of an entry.
fn head(line: &'static str) -> Option<Recipe> {
    let (name, rest) = line.strip_prefix('[')?.split_once(']')?;
    let (word, _) = name.split_once(':').unwrap_or((name, ""));
    let mut cells = rest.split('|').map(|cell| cell.split_whitespace());
    let class = cells.next()?.next()?;
    let places = cells.next()?.collect();
    let mut scale = cells.next()?.map(|number| number.parse().ok());
    Some(Recipe {
        name,
        kind: ThingKind { word, class },
        places,
        scale: [scale.next()??, scale.next()??],
        colors: cells.next()?.collect(),
        parts: Vec::new(),
    })
}

/// A further line of an entry.
fn part(line: &'static str) -> Option<Solid> {
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
        numbers: words
            .map(|number| number.parse().ok())
            .collect::<Option<_>>()?,
    })
}

impl Solid {
    fn is_known(&self) -> bool {
        let dull = Surface::plain([128, 128, 128]);
        self.shape == "light" && self.numbers.len() == 5
            || self.add_to(&mut Mesh::default(), &dull).is_some()
    }

    /// Adds the solid to a mesh; `None` if it has another number of numbers or an unknown name.
    fn add_to(&self, mesh: &mut Mesh, surface: &Surface) -> Option<()> {
        let point = |place: &[f32]| Vec3::from_slice(place);
        let pairs = |numbers: &[f32]| -> Vec<(f32, f32)> {
            numbers
                .chunks_exact(2)
                .map(|pair| (pair[0], pair[1]))
                .collect()
        };
        match (self.shape, &self.numbers[..]) {
            ("box", &[x, to_x, y, to_y, z, to_z]) => {
                mesh.block(vec3(x, y, z), vec3(to_x, to_y, to_z), surface);
            }
            ("soft", &[radius, x, to_x, y, to_y, z, to_z]) => {
                mesh.soft(vec3(x, y, z), vec3(to_x, to_y, to_z), radius, surface);
            }
            ("rod", [radius, ends @ ..]) if ends.len() == 6 => {
                mesh.rod(point(ends), point(&ends[3..]), *radius, surface);
            }
            ("cone", [from, to, ends @ ..]) if ends.len() == 6 => {
                mesh.cone(point(ends), point(&ends[3..]), [*from, *to], surface);
            }
            ("ball", at) if at.len() == 6 => mesh.ball(point(at), point(&at[3..]), surface),
            ("lathe", [x, y, z, depth, profile @ ..]) if profile.len() >= 4 => {
                mesh.oval(vec3(*x, *y, *z), &pairs(profile), *depth, surface);
            }
            ("turn", [x, y, z, depth, profile @ ..]) if profile.len() >= 4 => {
                mesh.vessel(vec3(*x, *y, *z), &pairs(profile), *depth, surface);
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
            Copies::Around(count, [x, z]) => (0..count).for_each(|turn| {
                let angle = std::f32::consts::TAU * turn as f32 / count as f32;
                mesh.add(&one, vec3(x, 0.0, z), angle);
            }),
        }
    }
}

/// The paint that a word of the table stands for.
fn paint(word: &str, dice: &mut Dice) -> Paint {
    let number = u32::from_str_radix(word, 16).ok();
    match number.filter(|_| word.len() == 6) {
        Some(number) => Paint::nameless(paint::codes(number)),
        None => Paint::random(&[word], dice),
    }
}

/// The surface that a word of the table stands for: a colour, and a sign for its material.
fn surface(word: &str, main: Paint, dice: &mut Dice) -> Surface {
    let color = word.trim_end_matches(['+', '~', '=', '/', '^', '%']);
    let paint = match color {
        "steel" => return Surface::steel(),
        "shade" => {
            return Surface {
                color: rgb([255, 238, 206]),
                pattern: Pattern::Plain,
                finish: SurfaceFinish::Glow(1.6),
            };
        }
        "flame" => {
            return Surface {
                color: rgb([255, 168, 60]),
                pattern: Pattern::Plain,
                finish: SurfaceFinish::Glow(1.1),
            };
        }
        "main" => main,
        "any" => Paint::random(&ALL, dice),
        color => paint(color, dice),
    };
    match &word[color.len()..] {
        "+" => Surface::gloss(paint),
        "~" => Surface::cloth(paint),
        "=" => Surface::wood(paint, 0),
        "/" => Surface::wood(paint, 1),
        "^" => Surface::paint(paint).with(Pattern::Pile),
        "%" => Surface::paint(paint).with(Pattern::Tiles([0.24, 0.08], rgb([186, 180, 170]))),
        _ => Surface::paint(paint),
    }
}

/// The piece of a name, of a random size in one of its colours. Empty for a name that the table does not have.
pub(in super::super) fn piece(name: &str, dice: &mut Dice) -> Piece {
    let colors = |recipe: &Recipe| match &recipe.colors[..] {
        [] => ALL.to_vec(),
        colors => colors.to_vec(),
    };
    let choice = RECIPES
        .iter()
        .find(|recipe| recipe.name == name)
        .map_or("", |recipe| dice.pick(&colors(recipe)));
    let main = paint(choice, dice);
    painted(name, main, dice)
}

/// The piece of a name in a paint, of a random size.
pub(in super::super) fn painted(name: &str, main: Paint, dice: &mut Dice) -> Piece {
    let mut mesh = Mesh::default();
    let Some(recipe) = RECIPES.iter().find(|recipe| recipe.name == name) else {
        let nothing = ThingKind {
            word: "",
            class: "objects",
        };
        return Piece::new(nothing, mesh, "");
    };
    let scale = dice.between(recipe.scale[0], recipe.scale[1]);
    let mut light = None;
    for part in &recipe.parts {
        match (part.shape, &part.numbers[..]) {
            ("light", &[x, y, z, radius, strength]) => {
                light = Some(LightSource::Bulb {
                    middle: vec3(x, y, z) * scale,
                    radius,
                    radiance: WARM * strength,
                });
            }
            _ => part.add_all_to(&mut mesh, &surface(part.surface, main, dice)),
        }
    }
    mesh.scale(scale);
    let mut piece = Piece::new(recipe.kind, mesh, main.name);
    piece.light = light;
    piece
}

/// The names of the things that are found at a place, as `floor`.
pub(in super::super) fn found(place: &str) -> Vec<&'static str> {
    RECIPES
        .iter()
        .filter(|recipe| recipe.places.contains(&place))
        .map(|recipe| recipe.name)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_read() {
        assert_eq!(read(TABLE).err(), None);
        let names: Vec<&str> = RECIPES.iter().map(|recipe| recipe.name).collect();
        for (place, name) in names.iter().enumerate() {
            assert!(!names[..place].contains(name), "{name} is there twice");
            let made = piece(name, &mut Dice::new(1, &[name]));
            assert!(made.mesh.faces.len() > 1, "{name}");
        }
    }

    #[test]
    fn a_line_that_makes_no_sense_is_named() {
        let head = "[x] objects | floor | 1 1 | red\n";
        for line in [
            "box main 1 2 3",
            "bax main 0 1 0 1 0 1",
            "*x box main 0 1 0 1 0 1",
        ] {
            let table: &'static str = format!("{head}{line}").leak();
            assert_eq!(read(table).err(), Some(line));
        }
        assert!(read("[x] objects | floor | one | red").is_err());
    }
}
