"""A run as a flat table: :func:`load_run`."""

from __future__ import annotations

import os
from collections.abc import Iterable
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ._run import Run, runs_in
from ._trial import COLUMNS, FROM_QUESTIONS, OUTCOMES, darkness

if TYPE_CHECKING:
    import pandas


def load_run(path: str | os.PathLike[str], questions: bool = True) -> pandas.DataFrame:
    """Read a run of ``darkqa-eval`` or ``darkqa-eval openeqa`` as a flat table with one row a trial.

    A trial is one question to one model in one condition. If a trial was asked again, its last record counts. An incomplete
    last line of ``records.jsonl``, as a killed process leaves it, is left out with a warning.

    The columns have the names of the fields in ``records.jsonl``. Fields of nested objects are columns of their own, as
    ``failure_kind``, ``prompt_tokens``, ``image_digest``. Besides:

    - ``scene``, ``text``: the scene of the frame (missing if the data name none) and the words of the question.
    - ``strict``, ``lenient``: the index of the choice that each reading found; ``why``, ``why_lenient``: why it found none.
    - ``answer``, ``predicted``, ``predicted_lenient``: the true choice and those that were read, as texts.
    - ``right``, ``right_lenient``: whether the choice is the true one; missing if the trial failed. A reply in which no
      choice was read is wrong.

    Leave out the rows of the models ``observer:other-room`` and ``observer:tiles`` when you compare models: they are the controls
    of ``observer``, which see the image of another frame (``shown_frame``) or the tiles of their own in another order.

    In a run of ``openeqa`` a row is an answer. Instead of the readings it has ``predicted`` (the answer as the judge gets
    it), ``judge``, ``mark`` and ``score`` (0 to 1), and ``outcome`` says whether there is a mark. ``scene`` is the walk and
    ``family`` the category. The requests to the judge are no rows.

    The categories of ``level`` and ``condition`` are in the order from light to dark. The rows are in the order of questions,
    conditions and models.

    Args:
        path: The folder of a run, or a folder with the shards of one run (``--shard``).
        questions: Whether to read ``questions.jsonl``. If not, the columns that need it are left out: ``scene`` and
            ``text``, for ``openeqa`` ``text`` and ``answer``; and questions are in the order of their names. The file of a run
            of ``openeqa`` is read all the same, because a mark belongs to all questions with the same words.

    Raises:
        ImportError: pandas is not installed.
        FileNotFoundError: There is no such folder, or a file of the run is missing.
        ValueError: The folder holds no run, a run of another version, runs that are not shards of one run, or a line
            that is not a record.
    """
    try:
        import pandas
    except ImportError as error:
        raise ImportError('load_run needs pandas: pip install pandas') from error
    runs = runs_in(Path(path))
    schema = runs[0].schema
    left_out = set() if questions else FROM_QUESTIONS[schema]
    kinds = {name: kind for name, kind in COLUMNS[schema].items() if name not in left_out}
    rows = [row for run in runs for row in _rows(run, list(kinds), questions)]
    rows.sort(key=lambda row: row.place)
    values = dict(zip(kinds, zip(*(row.values for row in rows)))) if rows else dict.fromkeys(kinds, ())
    # Categories that have an order; those of other columns are in the order of the alphabet.
    categories = {"outcome": OUTCOMES[schema]}
    for name in ("level", "condition"):
        dark = {value: row.darkness for row, value in zip(rows, values[name]) if value is not None}
        categories[name] = sorted(dark, key=lambda value: (dark[value], value))
    kinds_of = {
        name: pandas.CategoricalDtype(categories.get(name), ordered=name == "level") if kind == "category" else kind
        for name, kind in kinds.items()
    }
    return pandas.DataFrame({name: pandas.Series(list(values[name]), dtype=kinds_of[name]) for name in kinds})


class _Row(NamedTuple):
    """The values of a trial in the columns, and what decides its place in the table."""

    place: tuple[Any, ...]
    darkness: tuple[Any, ...]
    values: tuple[Any, ...]


def _rows(run: Run, columns: list[str], questions: bool) -> Iterable[_Row]:
    """The last record of each trial."""
    texts = run.questions() if questions else None
    values = itemgetter(*columns)
    latest: dict[str, _Row] = {}
    for record in run.records(texts):
        number = texts[record["question"]].get("place", 0) if texts is not None else 0
        dark = darkness(record)
        place = (number, record["question"], dark, record["model"], record.get("repeat", 0), record["key"])
        latest[record["key"]] = _Row(place, dark, values(record))
    return latest.values()
