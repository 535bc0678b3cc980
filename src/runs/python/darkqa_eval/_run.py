"""The folder of a run, or those of the shards of one run."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ._trial import CHOICE, COLUMNS, OPEN, Marks, Record, add_mark, add_question, add_readings, add_reply


class Run(NamedTuple):
    """The folder of a run or of one of its shards, with its manifest."""

    folder: Path
    manifest: dict[str, Any]

    @property
    def schema(self) -> str:
        return str(self.manifest["schema"])

    @property
    def shard(self) -> tuple[int, int]:
        """The number of the shard, from 1, and the number of all shards."""
        number, _, count = self.manifest["shard"].partition("/")
        return int(number), int(count)

    def questions(self) -> dict[str, Record]:
        """The questions by their names."""
        return {line["id"]: line for _, line in _lines(self.folder / "questions.jsonl")}

    def records(self, questions: dict[str, Record] | None) -> Iterator[Record]:
        """The records with the values of all columns; of a trial that was asked again first the earlier one.

        Args:
            questions: The questions of the run; ``None`` if their columns are not wanted.
        """
        settings = self.manifest["settings"]
        judge, protocol = settings.get("--judge"), settings.get("--protocol", "upstream")
        words = self._judged_words(questions)
        marks = self._marks(judge, protocol, words) if self.schema == OPEN else {}
        path = self.folder / "records.jsonl"
        for number, record in _lines(path):
            try:
                if record.get("step") == "mark":
                    continue
                if self.schema == OPEN:
                    add_mark(record, judge, protocol, marks, words.get(record["question"]))
                else:
                    add_readings(record)
                add_reply(record)
            except (AttributeError, KeyError, IndexError, TypeError) as error:
                raise ValueError(f"{path}:{number}: not a record of {self.schema}: {error!r}") from error
            if questions is not None:
                if record["question"] not in questions:
                    raise ValueError(
                        f"{path}:{number}: the question {record['question']!r} is not in questions.jsonl beside it: restore that "
                        "file, or load the run with questions=False"
                    )
                add_question(record, questions[record["question"]])
            yield record

    def _judged_words(self, questions: dict[str, Record] | None) -> dict[str, str]:
        """What a judge is told of each open question, by the name of the question."""
        if self.schema != OPEN:
            return {}
        if questions is None:
            questions = self.questions()
        parts = ("question", "answer", "extra_answers")
        return {name: json.dumps([question.get(part) for part in parts]) for name, question in questions.items()}

    def _marks(self, judge: str | None, protocol: str, words: dict[str, str]) -> Marks:
        """The marks of a judge, by what it is told: the words of the question and the answer.

        Two questions with the same words and the same answer have one mark.
        """
        return {
            (words[record["question"]], record["judged"]): record[protocol]
            for _, record in _lines(self.folder / "records.jsonl")
            if record.get("step") == "mark"
            and record["model"] == judge
            and record["failure"] is None
            and record["question"] in words
        }


def runs_in(path: Path) -> list[Run]:
    """The run in a folder, or the shards in it.

    Raises:
        FileNotFoundError: There is no such folder.
        ValueError: The folder holds neither, or the runs in it are not shards of one run.
    """
    if not path.is_dir():
        raise FileNotFoundError(f"{path}: no such folder; the folder of a run is expected, as `--out` names it")
    if (path / "manifest.json").is_file():
        return [_open(path)]
    runs = [_open(manifest.parent) for manifest in sorted(path.glob("*/manifest.json"))]
    if not runs:
        raise ValueError(f"{path}: neither a run nor a folder of shards: there is no manifest.json in it or one folder below")
    _check_shards(path, runs)
    return runs


def _open(folder: Path) -> Run:
    path = folder / "manifest.json"
    try:
        manifest = json.loads(path.read_bytes())
        schema, version = manifest["schema"], manifest["version"]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: not the manifest of a run: {error!r}") from error
    if schema not in COLUMNS:
        raise ValueError(
            f"{path}: {CHOICE} or {OPEN} is expected, and this run has the schema {schema!r}: load it with version {version} of "
            "darkqa-eval, which made it, or run it again with this version"
        )
    return Run(folder, manifest)


def _check_shards(path: Path, runs: list[Run]) -> None:
    """Check that runs are shards of one run, each there once; warn about those that are missing."""
    first = runs[0]
    for run in runs:
        if not run.manifest.get("shard"):
            raise ValueError(
                f"{path}: a run or the shards of one run are expected, and {run.folder.name} in it is no shard: load each run alone "
                "and join the tables with pandas.concat"
            )
        same = (first.schema, first.manifest["identity"], first.shard[1])
        if (run.schema, run.manifest["identity"], run.shard[1]) != same:
            raise ValueError(f"{path}: {run.folder.name} is a shard of another run than {first.folder.name}: load each run alone")
    found = [run.shard[0] for run in runs]
    missing = sorted(set(range(1, first.shard[1] + 1)) - set(found))
    if len(set(found)) < len(found):
        raise ValueError(f"{path}: a shard is there twice: {sorted(found)}; remove one of the two folders")
    if missing:
        warnings.warn(f"{path}: shards are missing: {missing} of {first.shard[1]}; the table has the others")


def _lines(path: Path) -> Iterator[tuple[int, Record]]:
    """The complete lines of a file of a run, with their numbers."""
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n"):
                warnings.warn(f"{path}:{number}: the last line is incomplete and was left out")
                return
            if not line.strip():
                # A damaged line stood here, and was set aside.
                continue
            try:
                yield number, json.loads(line)
            except ValueError as error:
                raise ValueError(f"{path}:{number}: not a line of JSON: {error}; restore the file") from error
