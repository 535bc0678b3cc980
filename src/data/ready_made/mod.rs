//! Reader of published sets of multiple-choice questions about images.
//!
//! 1. Find and open the files (`container/`): TSV, CSV, JSON, JSON lines and Parquet; a single file, shards, or a
//!    folder with or without the dataset card of a hub.
//! 2. Assign roles to the columns, by their names or by `--map` (`columns/`).
//! 3. Find the images (`pictures/`), text and options (`items.rs`, `choices/`) of each row (`cells/`).
//! 4. Choose one format for the answers of all rows (`choices/`). If two formats fit and disagree, stop instead of
//!    guessing.
//! 5. Stop at rows that cannot become questions, unless the user leaves them out (`omissions/`).
//! 6. Assign ids and frames to the questions (`pictures/`), and print the inferred mapping (`summary.rs`).
//!
//! The code is not specific to any set; further rules for well-known sets are presets in `sets.toml`.
//!
//! The optional `dataset.json` of a ready-made data set: [`FolderInfo`].

mod cells;
mod choices;
mod columns;
pub mod container;
mod groups;
mod items;
pub mod omissions;
mod pictures;
mod preset;
mod settings;
mod summary;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::bank::{check_family, unnamed};
use super::openeqa::ImageSource;
use super::root::Root;
use cells::{Cell, SetRows};
use choices::{SetQuestion, find_truths, is_native_format};
use columns::map::{CellFormat, ColumnMap, ColumnRole};
use columns::{ColumnRoles, FamilySource, ImageColumns, QuestionSource};
use container::{FileRelation, FoundFiles, SetFile};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::{Choices, Family, FrameId, Question, SetLight};
use groups::{GroupRule, Groups};
use items::{InstructionCounts, items, rows_with_images};
use omissions::{Omissions, RowOmission, omit_contradictions};
use pictures::{Ids, ImageForm, Scenes, SetFrames};
use summary::Summary;

pub(super) use choices::one_line;
pub(super) use container::is_set_folder;
pub(super) use pictures::{EmbeddedImage, SceneNames, Series};
pub(super) use preset::{is_known as is_known_set, names as known_sets};
pub(super) use summary::LEFT_OUT;

pub use container::{Archive, ParquetColumns, cached_snapshot, is_zip_file, refuse_lfs_pointer};
pub use omissions::SkipBad;

pub use settings::SetArgs;

/// Opens a set: a file, a pattern of files, a folder, or several files. `stem` is its name unless `dataset.json` has
/// one.
///
/// # Errors
/// If the set cannot be read without guessing. The error shows the columns, the inferred mapping, and a flag to fix it.
pub(super) fn open(places: &[PathBuf], stem: &str, args: &SetArgs) -> Result<ReadySet> {
    let place = places.first().map_or(Path::new(""), PathBuf::as_path);
    let preset = args.preset.as_deref().and_then(preset::find);
    let args = &preset.map_or_else(|| args.clone(), |preset| preset.complete(args));
    let FoundFiles { files, folder, further, archive, mut notes, joined } = container::find_files(places, args)?;
    let mut allowed_roots = args.root.data_root.clone();
    allowed_roots.extend(further);
    let root = Root::new(&folder, &allowed_roots)?;
    let info = match &archive {
        Some(archive) => FolderInfo::in_archive(archive)?,
        None => FolderInfo::in_folder(&root)?,
    };
    let files: Vec<Arc<SetFile>> = files.into_iter().map(Arc::new).collect();
    let place = match &*files {
        [file] => file.label.path.as_path(),
        _ => place,
    };
    let mut table = read_files(&files, joined, args)?;
    table.parse_cells(info.map.iter().chain(&args.map));
    let hint = match args.preset {
        Some(_) => None,
        None => preset::recognition_hint(&table.columns),
    };
    let (group, missing_group) = preset.map_or((None, None), |preset| preset.group(&table));
    let frame = frame_map(&table).filter(|_| is_native_format(&table) && table.find("image").is_none());
    let map = ColumnMap::merge(frame.iter().chain(&group).chain(&info.map).chain(&args.map));
    let (roles, set) = parse_rows(&table, &map, args, preset, ImageForm::Files).map_err(|problem| {
        let hint = hint.as_ref().map_or_else(String::new, |hint| format!("\n {hint}"));
        Error::data(place.display(), format_args!("{problem}{hint}"))
    })?;
    table.clear_columns(&roles.columns_to_clear());
    let name = match &*info.name {
        "" => stem.to_owned(),
        name => name.to_owned(),
    };
    let frames = SetFrames::new(&table, &root, archive.as_ref(), &files, &roles, ImageForm::Files, args.multi_image);
    notes.extend_from_slice(&table.notes);
    notes.extend(preset.map(preset::Preset::source));
    notes.extend(missing_group.filter(|_| map.entry(ColumnRole::Group).is_none()));
    let context = SetContext { place, name: &name, table: &table, roles: &roles, args };
    let scenes = Scenes::new(&table, &map, roles.scene.as_ref());
    let contents = assemble(&context, set, frames, scenes, notes, hint)?;
    Ok(ReadySet {
        rows: contents.rows,
        summary: contents.summary,
        format: if is_native_format(&table) { SetFormat::Native } else { SetFormat::Foreign },
        title: info.name,
        name,
        sources: contents.sources,
        series: contents.series,
        scenes: contents.scenes,
        questions: contents.questions,
    })
}

/// Reads the rows of all files.
///
/// # Errors
/// If a file cannot be read, or files of one table have different columns.
fn read_files(files: &[Arc<SetFile>], joined: FileRelation, args: &SetArgs) -> Result<SetRows> {
    let mut table = SetRows::default();
    let mut header: Option<BTreeSet<String>> = None;
    for file in files {
        file.read(args.rows.as_deref(), &mut table)?;
        let columns = table.columns_of_last_file();
        let first = header.get_or_insert_with(|| columns.clone());
        if joined == FileRelation::OneTable
            && let Some(name) = first.symmetric_difference(&columns).next()
        {
            let holder = if columns.contains(name) { file } else { &files[0] };
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

/// A ready-made set.
pub(super) struct ReadySet {
    /// Name in `dataset.json`, else of the file or folder.
    pub(super) name: String,
    /// Name in `dataset.json`; empty if there is none.
    pub(super) title: String,
    pub(super) sources: BTreeMap<FrameId, ImageSource>,
    /// Images of each question with several images, by the name of the series.
    pub(super) series: Series,
    pub(super) scenes: SceneNames,
    pub(super) questions: Vec<Question>,
    /// How the set was read, one fact per line.
    pub(super) summary: Vec<String>,
    pub(super) format: SetFormat,
    pub(super) rows: RowCounts,
}

/// Numbers of rows of a set.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RowCounts {
    pub(super) all: usize,
    /// Broken rows that were left out.
    pub(super) bad: usize,
}

/// Origin of the column layout of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SetFormat {
    /// This program's own layout. Nothing is inferred.
    Native,
    /// Layout of another tool, with inferred columns.
    Foreign,
}

/// Questions from a file whose frames belong to another data set.
pub(super) struct FileQuestions {
    pub(super) questions: Vec<Question>,
    /// Scenes that the file assigns to the frames.
    pub(super) scenes: SceneNames,
    /// How the file was read, one fact per line.
    pub(super) summary: Vec<String>,
    pub(super) format: SetFormat,
    pub(super) rows: RowCounts,
}

/// Maps the column `frame` to the image; `None` if the table has no such column.
fn frame_map(table: &SetRows) -> Option<ColumnMap> {
    table.find("frame").and_then(|_| "image=frame".parse().ok())
}

/// Reads a file of questions whose frames belong to another data set.
///
/// # Errors
/// As [`open`].
pub(super) fn questions_about_frames(file: &Path, args: &SetArgs) -> Result<FileQuestions> {
    let mut table = SetRows::default();
    SetFile::open(file.to_owned(), String::new())?.read(args.rows.as_deref(), &mut table)?;
    let frame = frame_map(&table);
    let folder = file.parent().unwrap_or(Path::new(""));
    let root = Root::new(folder, &args.root.data_root)?;
    let info = FolderInfo::in_folder(&root)?;
    table.parse_cells(info.map.iter().chain(&args.map));
    let map = ColumnMap::merge(frame.iter().chain(&info.map).chain(&args.map));
    let (roles, set) = parse_rows(&table, &map, args, None, ImageForm::Frames)
        .map_err(|problem| Error::data(file.display(), problem))?;
    let frames = SetFrames::new(&table, &root, None, &[], &roles, ImageForm::Frames, args.multi_image);
    let name = file.display().to_string();
    let context = SetContext { place: file, name: &name, table: &table, roles: &roles, args };
    let notes = table.notes.clone();
    let scenes = Scenes::new(&table, &map, roles.scene.as_ref());
    // Letters and numbers in place of texts are a guess, which the summary reports.
    let are_texts = set.answer_columns.iter().all(|column| column.ends_with("(text)"));
    let contents = assemble(&context, set, frames, scenes, notes, None)?;
    let mut summary = contents.summary;
    let format = if is_native_format(&table) && info.map.is_none() {
        summary.retain(|line| !are_texts || line.starts_with(LEFT_OUT));
        SetFormat::Native
    } else {
        SetFormat::Foreign
    };
    Ok(FileQuestions { questions: contents.questions, scenes: contents.scenes, summary, format, rows: contents.rows })
}

/// Questions of a set, the sources of their frames, and the summary of the set.
struct SetContents {
    questions: Vec<Question>,
    sources: BTreeMap<FrameId, ImageSource>,
    series: Series,
    scenes: SceneNames,
    summary: Vec<String>,
    rows: RowCounts,
}

/// Table of a set, its columns and the settings to read it.
struct SetContext<'a> {
    place: &'a Path,
    name: &'a str,
    table: &'a SetRows,
    roles: &'a ColumnRoles,
    args: &'a SetArgs,
}

/// Assigns ids, frames and scenes to the questions, and summarizes the set (step 6).
///
/// The summary lists `notes` before the notes about scenes and ids, and `hint` after them.
fn assemble(
    context: &SetContext<'_>,
    mut set: ParsedSet,
    mut frames: SetFrames<'_>,
    mut scenes: Scenes<'_>,
    mut notes: Vec<String>,
    hint: Option<String>,
) -> Result<SetContents> {
    omit_unusable_images(context, &mut set, &frames)?;
    let mut ids = frames.ids(&set.questions).map_err(with_skip_hint)?;
    if !ids.contradictions().is_empty() {
        omit_contradictions(context.table, context.args, &mut set.questions, &mut set.omissions, ids.contradictions())
            .map_err(|problem| Error::data(context.place.display(), problem))?;
        ids = frames.ids(&set.questions).map_err(with_skip_hint)?;
    }
    let id_columns = &context.roles.ids;
    if is_native_format(context.table)
        && !id_columns.is_empty()
        && id_columns.iter().all(|column| column.name != ids.source())
    {
        tracing::warn!(
            "{}: some questions have no id or the same, so all get an id from their content",
            context.place.display()
        );
    }
    let families = FamilySource::choose(context.table, &context.roles.families, &set.questions);
    let questions = build_questions(context, &families, &set.groups, set.questions, &ids, &mut frames, &mut scenes)?;
    let (sources, series) = frames.take_sources();
    notes.extend(scenes.note());
    notes.extend(ids.note());
    notes.extend(hint);
    let summary = Summary {
        name: context.name,
        table: context.table,
        roles: context.roles,
        families: &families,
        answers: &set.answer_columns,
        ids: ids.source(),
        cut_instructions: &set.cut_instructions,
        omissions: &set.omissions,
        groups: set.groups.describe(&questions),
        sources: &sources,
        series: &series,
        questions: &questions,
        notes,
    }
    .lines();
    let rows = RowCounts { all: context.table.rows.len(), bad: set.omissions.bad().map_or(0, |(count, _)| count) };
    Ok(SetContents { rows, questions, sources, series, scenes: scenes.take(), summary })
}

/// With `--skip bad`, leaves out rows whose image is missing or is not an image.
///
/// Without the flag, reading such an image is an error. Rows whose image cannot be decoded are left out later
/// ([`Dataset::without_unusable`](crate::Dataset::without_unusable)).
fn omit_unusable_images(context: &SetContext<'_>, set: &mut ParsedSet, frames: &SetFrames<'_>) -> Result<()> {
    if context.args.bad.is_none() {
        return Ok(());
    }
    let ParsedSet { questions, omissions, .. } = set;
    questions.retain(|question| match frames.problem(question.row) {
        None => true,
        Some(problem) => {
            omissions.add(RowOmission::Bad, || match problem {
                Error::Data { problem, .. } => {
                    format!("{}: {problem}", context.table.place_in_set(question.row))
                }
                other => other.to_string(),
            });
            false
        }
    });
    omissions
        .check(context.table.rows.len(), context.args)
        .map_err(|problem| Error::data(context.place.display(), problem))
}

/// Questions of a set with their correct options.
struct ParsedSet {
    questions: Vec<SetQuestion>,
    /// Columns and formats of the answers, for the summary.
    answer_columns: Vec<String>,
    cut_instructions: InstructionCounts,
    omissions: Omissions,
    groups: Groups,
}

/// Parses the rows into questions with their correct options (steps 2 to 5).
fn parse_rows(
    table: &SetRows,
    map: &ColumnMap,
    args: &SetArgs,
    preset: Option<&preset::Preset>,
    form: ImageForm,
) -> Result<(ColumnRoles, ParsedSet), String> {
    if table.rows.is_empty() {
        return Err("no questions in it".to_owned());
    }
    if args.images_alone {
        return parse_images(table, map, args, form);
    }
    let roles = ColumnRoles::new(table, map)?;
    let rule = GroupRule::from_map(table, map)?;
    let (mut omissions, mut cut_instructions) = (Omissions::default(), InstructionCounts::new());
    let mut items = items(table, &roles, form, args, &mut omissions, &mut cut_instructions)?;
    let is_rotation = |row| preset.is_some_and(|preset| preset.is_rotation(table, row));
    for item in items.extract_if(.., |item| is_rotation(item.row)) {
        omissions.add(RowOmission::Rotation, || table.place(item.row));
    }
    if items.is_empty() {
        omissions.check(table.rows.len(), args).map_err(|problem| with_image_hint(table, &roles, problem))?;
        return Err("no row is left to ask".to_owned());
    }
    let format = map.entry(ColumnRole::Answer).map_or(&CellFormat::Inferred, |entry| &entry.format);
    let truths = find_truths(table, &roles, format, items, &mut omissions)?;
    omissions.check(table.rows.len(), args).map_err(|problem| with_image_hint(table, &roles, problem))?;
    if truths.questions.is_empty() {
        return Err("no row is left to ask".to_owned());
    }
    let set = ParsedSet {
        groups: rule.map_or_else(Groups::default, |rule| Groups::new(table, &rule, is_rotation)),
        questions: truths.questions,
        answer_columns: truths.columns,
        cut_instructions,
        omissions,
    };
    Ok((roles, set))
}

/// Finds the images of the rows. Each row with an image has a question that is not asked.
fn parse_images(
    table: &SetRows,
    map: &ColumnMap,
    args: &SetArgs,
    form: ImageForm,
) -> Result<(ColumnRoles, ParsedSet), String> {
    let mut roles = ColumnRoles::with_question(table, map, QuestionSource::Image)?;
    let is_named = map.entry(ColumnRole::Image).is_some()
        || table.rows.iter().any(|row| !pictures::images(row, &roles).is_empty());
    if let Some(column) = columns::embedded_images(table).filter(|_| !is_named) {
        roles.images = ImageColumns::First(vec![column]);
    }
    let mut omissions = Omissions::default();
    let rows = rows_with_images(table, &roles, form, args, &mut omissions);
    omissions.check(table.rows.len(), args).map_err(|problem| with_image_hint(table, &roles, problem))?;
    let choices = Choices::without_truth(vec!["yes".to_owned(), "no".to_owned()]).map_err(|e| e.to_string())?;
    let questions =
        rows.into_iter().map(|(row, _)| SetQuestion { row, text: row.to_string(), choices: choices.clone() }).collect();
    let set = ParsedSet {
        questions,
        answer_columns: Vec::new(),
        cut_instructions: InstructionCounts::new(),
        omissions,
        groups: Groups::default(),
    };
    Ok((roles, set))
}

/// Adds the columns and an example of `--map image=…` to a problem, if no row has an image.
fn with_image_hint(table: &SetRows, roles: &ColumnRoles, problem: String) -> String {
    let has_images = table.rows.iter().any(|row| !pictures::images(row, roles).is_empty());
    if has_images {
        return problem;
    }
    let named_image = table.columns.iter().enumerate().find(|(index, name)| {
        name.to_lowercase().contains("image")
            && table.rows.iter().all(|row| matches!(row.cell(*index), Cell::Text(_) | Cell::Number(_)))
    });
    let key = named_image
        .map(|(_, name)| name.as_str())
        .or(roles.ids.first().map(|column| column.name.as_str()))
        .or(table.columns.first().map(String::as_str))
        .unwrap_or("id");
    format!(
        "{problem}\n its columns:\n{}\n if files hold the images, say how they are named, e.g. {}",
        columns::describe_columns(table),
        columns::map::map_flag(ColumnRole::Image, &format!("images/{{{key}}}.jpg"), None)
    )
}

/// Adds a hint about `--skip bad` to an error about the image of a row.
fn with_skip_hint(error: Error) -> Error {
    const FLAG: &str = "--skip bad";
    match error {
        Error::Data { place, problem } if !problem.contains(FLAG) => {
            Error::data(place, format_args!("{problem}; {FLAG} leaves such rows out"))
        }
        other => other,
    }
}

/// Builds the questions. Collects the sources of the frames in `frames` and the scenes in `scenes`.
fn build_questions(
    context: &SetContext<'_>,
    families: &FamilySource,
    groups: &Groups,
    parsed: Vec<SetQuestion>,
    ids: &Ids,
    frames: &mut SetFrames<'_>,
    scenes: &mut Scenes<'_>,
) -> Result<Vec<Question>> {
    let (table, evidence) = (context.table, context.roles.evidence.as_ref());
    let mut questions = Vec::with_capacity(parsed.len());
    for (index, question) in parsed.into_iter().enumerate() {
        let row = question.row;
        let frame = frames.frame(&question).map_err(with_skip_hint)?;
        scenes.add(table, row, &frame)?;
        let cells = &table.rows[row];
        let family = match families.family(table, cells) {
            Some(name) => Family::from(name.as_str()),
            None => unnamed(),
        };
        questions.push(Question {
            id: ids.id(index),
            frame,
            family: check_family(family).map_err(|e| e.at(table.place(row)))?,
            text: question.text,
            choices: question.choices,
            group: groups.group(row),
            evidence: evidence.map(|column| serde_json::Value::from(column.cell(cells)).into()).unwrap_or_default(),
        });
    }
    Ok(questions)
}

/// The fields that are read from `dataset.json`.
#[derive(Debug, Default)]
pub(super) struct FolderInfo {
    /// Name of the data set; empty if none is given.
    name: String,
    /// Column mapping; `None` if none is given.
    map: Option<ColumnMap>,
}

impl FolderInfo {
    const FILE: &str = "dataset.json";

    /// Reads `dataset.json` in a folder; the default if it does not exist.
    ///
    /// # Errors
    /// If the file cannot be read, or is a link out of the folders of `root`.
    fn in_folder(root: &Root) -> Result<Self> {
        let Some(path) = root.own_file(Self::FILE)? else {
            return Ok(Self::default());
        };
        Self::read(&path, &files::json(&path)?)
    }

    /// Reads `dataset.json` at the top level of a ZIP file; the default if it does not exist.
    fn in_archive(archive: &Archive) -> Result<Self> {
        if !archive.has(Self::FILE) {
            return Ok(Self::default());
        }
        let path = archive.path().join(Self::FILE);
        let text = archive.read_text(Self::FILE)?;
        let info: serde_json::Value = serde_json::from_str(&text).map_err(|e| Error::data(path.display(), e))?;
        Self::read(&path, &info)
    }

    fn read(path: &Path, info: &serde_json::Value) -> Result<Self> {
        let map = text_field(info, "map")
            .map(str::parse::<ColumnMap>)
            .transpose()
            .map_err(|problem| Error::data(path.display(), format_args!("map: {problem}")))?;
        Ok(Self { name: text_field(info, "name").unwrap_or_default().to_owned(), map })
    }
}

/// Light in which the photographs of a ZIP file were taken, from its `dataset.json`; lit by default.
pub(super) fn light_of_archive(path: &Path) -> Result<SetLight> {
    let archive = Archive::open(path)?;
    if !archive.has(FolderInfo::FILE) {
        return Ok(SetLight::Lit);
    }
    let wrong = |e| Error::data(path.join(FolderInfo::FILE).display(), e);
    let text = archive.read_text(FolderInfo::FILE)?;
    let mut info: serde_json::Value = serde_json::from_str(&text).map_err(wrong)?;
    match info.get_mut("light") {
        Some(light) => serde_json::from_value(light.take()).map_err(wrong),
        None => Ok(SetLight::Lit),
    }
}

fn text_field<'a>(info: &'a serde_json::Value, key: &str) -> Option<&'a str> {
    info.get(key).and_then(serde_json::Value::as_str)
}
