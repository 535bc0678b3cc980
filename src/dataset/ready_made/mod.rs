//! Ready-made sets of multiple-choice questions about images, in any of the forms in which they are published.
//!
//! 1. The files are found and opened (`container/`): TSV, CSV, JSON, JSON lines and Parquet; alone, in shards, or in a folder with or
//!    without the card of a hub.
//! 2. The columns are told by their names, or by the user (`columns/`).
//! 3. Each row (`cells/`) has its images (`pictures/`), its text and its options (`items.rs`, `choices/`).
//! 4. The answers of all rows are read in one way (`choices/`). Where two ways fit and differ, nothing is guessed.
//! 5. Rows that cannot be asked stop the reading, unless the user leaves them out (`omissions/`).
//! 6. Questions get ids and frames (`pictures/`), and the inferred mapping is printed (`summary.rs`).
//!
//! No code is for one set alone; what well-known sets need beyond these rules stands in `sets.toml`.

mod cells;
mod choices;
mod columns;
mod container;
mod folder_info;
mod groups;
mod items;
mod omissions;
mod pictures;
mod preset;
mod settings;
mod summary;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::family::{check_family, unnamed};
use super::image_source::ImageSource;
use super::root::Root;
use crate::error::{Error, Result};
use crate::types::{Family, FrameId, Question};

pub(super) use choices::one_line;
pub(super) use container::{Archive, is_set_folder};
pub(crate) use omissions::SkipBad;
pub(super) use pictures::{EmbeddedImage, SceneNames, Series};
pub(super) use preset::{is_known as is_known_set, names as known_sets};
pub use settings::SetArgs;
pub(super) use summary::LEFT_OUT;

use cells::Table;
use choices::{Answered, is_own, truths};
use columns::map::{CellFormat, Map};
use columns::names::Role;
use columns::{FamilyOf, Roles};
use container::{FoundFiles, Joined, SetFile};
use folder_info::FolderInfo;
use groups::{GroupRule, Groups};
use items::{InstructionCounts, items};
use omissions::{OmissionReason, Omissions, leave_out};
use pictures::{Frames, Ids, ImageForm, Scenes};
use summary::Summary;

/// The set at a place: a file, a pattern of files, a folder, or several files.
///
/// # Errors
/// If it cannot be read without guessing. The error shows the columns, the inferred mapping, and a flag that repairs it.
pub(super) fn open(places: &[PathBuf], stem: &str, args: &SetArgs) -> Result<ReadySet> {
    let place = places.first().map_or(Path::new(""), PathBuf::as_path);
    let preset = preset::named(args.preset.as_deref());
    let args = &preset.map_or_else(|| args.clone(), |preset| preset.beneath(args));
    let found = container::find(places, args)?;
    let FoundFiles {
        files,
        folder,
        further: allowed,
        archive,
        notes,
        joined,
    } = found;
    let info = match &archive {
        Some(archive) => FolderInfo::in_archive(archive)?,
        None => FolderInfo::in_folder(&folder)?,
    };
    let mut further = args.root.data_root.clone();
    further.extend(allowed);
    let root = Root::new(&folder, &further)?;
    let files: Vec<Arc<SetFile>> = files.into_iter().map(Arc::new).collect();
    let mut table = rows(&files, joined, args)?;
    table.parse_cells(info.map.iter().chain(&args.map));
    let (group, no_group) = preset.map_or((None, None), |preset| preset.group(&table));
    let frame = frame_map(&table).filter(|_| is_own(&table) && table.find("image").is_none());
    let map = Map::joined(frame.iter().chain(&group).chain(&info.map).chain(&args.map));
    let wrong = |table: &Table, problem: String| {
        let hint = preset::recognised(&table.columns, args.preset.as_deref());
        let hint = hint.map_or_else(String::new, |hint| format!("\n {hint}"));
        Error::data(place.display(), format_args!("{problem}{hint}"))
    };
    let (roles, set) = read(&table, &map, args, preset, ImageForm::Files)
        .map_err(|problem| wrong(&table, problem))?;
    table.forget(&roles.read_once());
    let name = match &*info.name {
        "" => stem.to_owned(),
        name => name.to_owned(),
    };
    let frames = Frames::new(
        &table,
        &root,
        archive.as_ref(),
        &files,
        &roles,
        ImageForm::Files,
        args.multi_image,
    );
    let mut notes = notes;
    notes.append(&mut table.notes.clone());
    notes.extend(preset.map(preset::Preset::source));
    notes.extend(no_group.filter(|_| map.entry(Role::Group).is_none()));
    let hint = preset::recognised(&table.columns, args.preset.as_deref());
    let opened = Opened {
        place,
        name: &name,
        table: &table,
        roles: &roles,
        args,
    };
    let scenes = Scenes::new(&table, &map, roles.scene.as_ref());
    let asked = finish(&opened, set, (frames, scenes), notes, hint)?;
    Ok(ReadySet {
        rows: asked.rows,
        summary: asked.reading,
        format: if is_own(&table) {
            SetFormat::Native
        } else {
            SetFormat::Foreign
        },
        title: info.name,
        name,
        sources: asked.sources,
        series: asked.series,
        scenes: asked.scenes,
        questions: asked.questions,
    })
}

/// The rows of all files.
///
/// # Errors
/// If a file cannot be read, or files of one table differ in their columns.
fn rows(files: &[Arc<SetFile>], joined: Joined, args: &SetArgs) -> Result<Table> {
    let mut table = Table::default();
    let mut header: Option<BTreeSet<String>> = None;
    for file in files {
        file.read(args.rows.as_deref(), &mut table)?;
        let columns = table.columns_of_last_file();
        let first = header.get_or_insert_with(|| columns.clone());
        if joined == Joined::OneTable
            && let Some(name) = first.symmetric_difference(&columns).next()
        {
            let holder = if columns.contains(name) {
                file
            } else {
                &files[0]
            };
            let problem = format!(
                "not the columns of {}: {name:?} is in {} alone; files that are joined have the same columns, in any order",
                files[0].label.path.display(),
                holder.label.path.display()
            );
            return Err(Error::data(file.label.path.display(), problem));
        }
    }
    Ok(table)
}

/// A set that was read.
pub(super) struct ReadySet {
    /// The name in `dataset.json`, else that of the file or folder.
    pub(super) name: String,
    /// The name in `dataset.json`; empty if there is none.
    pub(super) title: String,
    pub(super) sources: BTreeMap<FrameId, ImageSource>,
    /// The images of each question that shows several, by the name of its frame.
    pub(super) series: Series,
    pub(super) scenes: SceneNames,
    pub(super) questions: Vec<Question>,
    /// The inferred column mapping, one line per column.
    pub(super) summary: Vec<String>,
    pub(super) format: SetFormat,
    pub(super) rows: RowCounts,
}

/// The numbers of rows of a set.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RowCounts {
    pub(super) all: usize,
    /// Broken rows, which are left out.
    pub(super) bad: usize,
}

/// Origin of the layout of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SetFormat {
    /// This program's, in which nothing has to be found out.
    Native,
    /// Another tool's file.
    Foreign,
}

/// The questions of a file about frames of other data.
pub(super) struct FileQuestions {
    pub(super) questions: Vec<Question>,
    /// The scenes that the file gives to the frames.
    pub(super) scenes: SceneNames,
    /// The inferred column mapping, one line per column.
    pub(super) summary: Vec<String>,
    pub(super) format: SetFormat,
    pub(super) rows: RowCounts,
}

/// Maps the column `frame` to the image, if it exists.
fn frame_map(table: &Table) -> Option<Map> {
    let frame = table.find("frame");
    frame.and_then(|_| "image=frame".parse().ok())
}

/// The questions of a file about frames of other data.
///
/// # Errors
/// As [`open`].
pub(super) fn questions_about_frames(file: &Path, args: &SetArgs) -> Result<FileQuestions> {
    let mut table = Table::default();
    SetFile::open(file.to_owned(), String::new())?.read(args.rows.as_deref(), &mut table)?;
    let own = frame_map(&table);
    let folder = file.parent().unwrap_or(Path::new(""));
    let info = FolderInfo::in_folder(folder)?;
    table.parse_cells(info.map.iter().chain(&args.map));
    let map = Map::joined(own.iter().chain(&info.map).chain(&args.map));
    let (roles, set) = read(&table, &map, args, None, ImageForm::Frames)
        .map_err(|problem| Error::data(file.display(), problem))?;
    let root = Root::new(folder, &[])?;
    let frames = Frames::new(
        &table,
        &root,
        None,
        &[],
        &roles,
        ImageForm::Frames,
        args.multi_image,
    );
    let name = file.display().to_string();
    let opened = Opened {
        place: file,
        name: &name,
        table: &table,
        roles: &roles,
        args,
    };
    let notes = table.notes.clone();
    let scenes = Scenes::new(&table, &map, roles.scene.as_ref());
    let asked = finish(&opened, set, (frames, scenes), notes, None)?;
    let mut reading = asked.reading;
    let form = if is_own(&table) && info.map.is_none() {
        reading.retain(|line| line.starts_with(LEFT_OUT));
        SetFormat::Native
    } else {
        SetFormat::Foreign
    };
    Ok(FileQuestions {
        questions: asked.questions,
        scenes: asked.scenes,
        summary: reading,
        format: form,
        rows: asked.rows,
    })
}

/// The questions of a set, the sources of their frames, and the inferred mapping.
struct Finished {
    questions: Vec<Question>,
    sources: BTreeMap<FrameId, ImageSource>,
    series: Series,
    scenes: SceneNames,
    reading: Vec<String>,
    rows: RowCounts,
}

/// A set that is being read.
struct Opened<'a> {
    place: &'a Path,
    name: &'a str,
    table: &'a Table,
    roles: &'a Roles,
    args: &'a SetArgs,
}

/// Step 6. `notes` stand before the note about ids, and `hint` behind it.
fn finish(
    opened: &Opened<'_>,
    mut set: ReadSet,
    (mut frames, mut scenes): (Frames<'_>, Scenes<'_>),
    mut notes: Vec<String>,
    hint: Option<String>,
) -> Result<Finished> {
    leave_out_unusable(opened, &mut set, &frames)?;
    let mut ids = frames.ids(&set.answered).map_err(with_skip)?;
    if !ids.contradictory().is_empty() {
        let pairs = ids.contradictory();
        leave_out(
            opened.table,
            opened.args,
            &mut set.answered,
            &mut set.left,
            pairs,
        )
        .map_err(|problem| Error::data(opened.place.display(), problem))?;
        ids = frames.ids(&set.answered).map_err(with_skip)?;
    }
    let family = FamilyOf::from_table(opened.table, &opened.roles.families, &set.answered);
    let groups = (&family, &set.groups);
    let questions = questions(
        opened,
        groups,
        set.answered,
        &ids,
        (&mut frames, &mut scenes),
    )?;
    let (sources, series) = frames.take_sources();
    notes.extend(scenes.note());
    notes.extend(ids.note());
    notes.extend(hint);
    let summary = Summary {
        name: opened.name,
        table: opened.table,
        roles: opened.roles,
        family: &family,
        answers: &set.said,
        ids: ids.name(),
        cut: &set.cut,
        left: &set.left,
        groups: set.groups.said(&questions),
        sources: &sources,
        series: &series,
        questions: &questions,
        notes,
    };
    let reading = summary.lines();
    let rows = RowCounts {
        all: opened.table.rows.len(),
        bad: set.left.bad().map_or(0, |(count, _)| count),
    };
    Ok(Finished {
        rows,
        questions,
        sources,
        series,
        scenes: scenes.take(),
        reading,
    })
}

/// Leaves out the rows with an image that is not there or is none, with `--skip bad`; without it such an image is named when it is read.
/// Images that are there and cannot be decoded are left out later ([`Dataset::without_unusable`](crate::dataset::Dataset::without_unusable)).
fn leave_out_unusable(opened: &Opened<'_>, set: &mut ReadSet, frames: &Frames<'_>) -> Result<()> {
    if opened.args.bad.is_none() {
        return Ok(());
    }
    let ReadSet { answered, left, .. } = set;
    answered.retain(|question| match frames.problem(question.row) {
        None => true,
        Some(problem) => {
            left.add(OmissionReason::Bad, || problem.to_string());
            false
        }
    });
    let checked = left.check(opened.table.rows.len(), opened.args);
    checked.map_err(|problem| Error::data(opened.place.display(), problem))
}

/// The rows of a set with their truths.
struct ReadSet {
    answered: Vec<Answered>,
    said: Vec<String>,
    cut: InstructionCounts,
    left: Omissions,
    groups: Groups,
}

/// Steps 2 to 5: from rows to questions with truths.
fn read(
    table: &Table,
    map: &Map,
    args: &SetArgs,
    preset: Option<&preset::Preset>,
    kind: ImageForm,
) -> Result<(Roles, ReadSet), String> {
    if table.rows.is_empty() {
        return Err("no questions in it".to_owned());
    }
    let roles = Roles::new(table, map)?;
    let rule = GroupRule::from_map(table, map)?;
    let (mut left, mut cut) = (Omissions::default(), InstructionCounts::new());
    let mut kept = items(table, &roles, kind, args, &mut left, &mut cut)?;
    let is_copy = |row| preset.is_some_and(|preset| preset.is_rotation(table, row));
    for item in kept.extract_if(.., |item| is_copy(item.row)) {
        left.add(OmissionReason::Rotation, || table.place(item.row));
    }
    if kept.is_empty() {
        left.check(table.rows.len(), args)
            .map_err(|problem| image_hint(table, &roles, problem))?;
        return Err("no row is left to ask".to_owned());
    }
    let how = map
        .entry(Role::Answer)
        .map_or(&CellFormat::ByRule, |entry| &entry.how);
    let truths = truths(table, &roles, how, kept, &mut left)?;
    left.check(table.rows.len(), args)
        .map_err(|problem| image_hint(table, &roles, problem))?;
    if truths.answered.is_empty() {
        return Err("no row is left to ask".to_owned());
    }
    let set = ReadSet {
        groups: rule.map_or_else(Groups::default, |rule| Groups::new(table, &rule, is_copy)),
        answered: truths.answered,
        said: truths.said,
        cut,
        left,
    };
    Ok((roles, set))
}

/// Adds the columns and a `--map` for images to a problem, if no row has any.
fn image_hint(table: &Table, roles: &Roles, problem: String) -> String {
    let are_there = table
        .rows
        .iter()
        .any(|row| !pictures::images(row, roles).is_empty());
    if are_there {
        return problem;
    }
    let key = roles.ids.first().map(|column| column.name.as_str());
    let key = key
        .or(table.columns.first().map(String::as_str))
        .unwrap_or("id");
    format!(
        "{problem}\n its columns:\n{}\n if files hold the images, say how they are named, e.g. {}",
        columns::shown(table),
        columns::map::flag(Role::Image, &format!("images/{{{key}}}.jpg"), None)
    )
}

/// The error of an image that is not there, with the flag that leaves its row out.
fn with_skip(error: Error) -> Error {
    const FLAG: &str = "--skip bad";
    match error {
        Error::Data { place, problem } if !problem.contains(FLAG) => Error::data(
            place,
            format_args!("{problem}; {FLAG} leaves such rows out"),
        ),
        other => other,
    }
}

/// The questions. The sources of their frames are kept in `frames`, and their scenes in `scenes`.
fn questions(
    opened: &Opened<'_>,
    (families, groups): (&FamilyOf, &Groups),
    answered: Vec<Answered>,
    ids: &Ids,
    (frames, scenes): (&mut Frames<'_>, &mut Scenes<'_>),
) -> Result<Vec<Question>> {
    let (table, evidence) = (opened.table, opened.roles.evidence.as_ref());
    let mut questions = Vec::with_capacity(answered.len());
    for (at, answered) in answered.into_iter().enumerate() {
        let row = answered.row;
        let frame = frames.frame(&answered).map_err(with_skip)?;
        scenes.add(table, row, &frame)?;
        let cells = &table.rows[row];
        let family = families.text(table, cells);
        let family = family.unwrap_or_else(|| unnamed().name().to_owned());
        let family =
            check_family(Family::from(family.as_str())).map_err(|e| e.at(table.place(row)))?;
        questions.push(Question {
            id: ids.id(at),
            frame,
            family,
            text: answered.text,
            choices: answered.choices,
            group: groups.group(row),
            evidence: evidence.map_or(serde_json::Value::Null, |column| column.cell(cells).into()),
        });
    }
    Ok(questions)
}

#[cfg(test)]
mod tests;
