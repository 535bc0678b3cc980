"""The columns of a trial, and their values from its record.

A record is one line of ``records.jsonl``; ``src/docs/files.md`` describes it. The functions here add what the table shows
besides, under the names of the columns.
"""

from __future__ import annotations

from typing import Any, Optional

Record = dict[str, Any]
# The marks of a judge, by what it is told: the words of the question and the answer. None if its reply has no mark.
Marks = dict[tuple[Optional[str], str], Optional[int]]

CHOICE = "darkqa.run/2"
OPEN = "darkqa.openeqa/2"

# Each group maps columns to pandas types. Int16 is for indices and status codes, Int64 for all else.
_QUESTION = {
    "key": "string",
    "question": "string",
    "scene": "string",
    "frame": "string",
    "family": "category",
    "text": "string",
}
_CONDITION = {
    "model": "category",
    "view": "category",
    "condition": "category",
    "level": "category",
    "variant": "category",
    "ev": "float64",
    "reading": "category",
    "enhancer": "category",
}
_READINGS = {
    "repeat": "Int16",
    "choices": "object",
    "choice_count": "Int16",
    "truth": "Int16",
    "answer": "string",
    "outcome": "category",
    "strict": "Int16",
    "predicted": "string",
    "right": "boolean",
    "why": "category",
    "lenient": "Int16",
    "predicted_lenient": "string",
    "right_lenient": "boolean",
    "why_lenient": "category",
}
_MARK = {
    "person": "category",
    "answer": "string",
    "outcome": "category",
    "predicted": "string",
    "judge": "category",
    "mark": "Int64",
    "score": "float64",
}
_REPLY = {
    "reply": "string",
    "refusal": "string",
    "finish": "category",
    "served_model": "category",
    "via": "category",
    "failure_kind": "category",
    "failure_status": "Int16",
    "failure_message": "string",
    "prompt_tokens": "Int64",
    "completion_tokens": "Int64",
    "cached_tokens": "Int64",
    "latency_ms": "Int64",
    "attempts": "Int64",
    "provider": "category",
    "endpoint": "Int16",
}
_IMAGE = {
    "image_digest": "string",
    "image_bytes": "Int64",
    "image_width": "Int64",
    "image_height": "Int64",
    "image_format": "category",
}

# What the observer saw; missing for other models.
_OBSERVED = {
    "shown_frame": "string",
    "observed_from": "category",
    "observed_things": "Int64",
    "observed_seen": "Int64",
    "observed_detected": "Int64",
    "observed_explained_ppm": "Int64",
}

# The combination of wording, order and draw in which a question was asked.
_COMBINATION = {
    "wording": "category",
    "order": "Int16",
    "draw": "Int16",
}

# The columns of each kind of run, in the order of the table.
COLUMNS = {
    CHOICE: {**_QUESTION, **_CONDITION, **_READINGS, **_REPLY, **_IMAGE, **_OBSERVED, **_COMBINATION},
    OPEN: {**_QUESTION, **_CONDITION, **_MARK, **_REPLY, "image_count": "Int64", **_IMAGE},
}
# The columns whose values stand only in questions.jsonl.
FROM_QUESTIONS = {CHOICE: {"scene", "text"}, OPEN: {"text", "answer"}}
# All values of the column `outcome`, so that each is counted, also if no trial has it.
OUTCOMES = {
    CHOICE: ["right", "wrong", "answered", "unparsed", "failed"],
    OPEN: ["marked", "null", "unmarked", "unjudged", "failed"],
}


def add_question(record: Record, question: Record) -> None:
    """Add what ``questions.jsonl`` says about the question of a record."""
    record["text"] = question["question"]
    record["scene"] = question.get("scene") or None
    record.setdefault("answer", question["answer"])


def add_readings(record: Record) -> None:
    """Add the choices as texts, and what the strict and the lenient parsing found in the reply."""
    choices, truth = record["choices"], record["truth"]
    for name, default in (("repeat", 0), ("wording", None), ("order", 0), ("draw", 0)):
        record.setdefault(name, default)
    record.setdefault("shown_frame", None)
    observed = record.get("observed") or {}
    for name in ("from", "things", "seen", "detected", "explained_ppm"):
        record[f"observed_{name}"] = observed.get(name)
    # Nobody knows the true answers to questions that are asked about every image (--ask): no reply is right or wrong.
    answer = None if truth is None else choices[truth]
    record.update(choices=tuple(choices), choice_count=len(choices), answer=answer)
    for mode, suffix in (("strict", ""), ("lenient", "_lenient")):
        read = record[mode] or {"chosen": None, "why": None}
        chosen = read["chosen"]
        record["right" + suffix] = None if record[mode] is None or truth is None else chosen == truth
        record["predicted" + suffix] = None if chosen is None else choices[chosen]
        record["why" + suffix] = read["why"]
        record[mode] = chosen


def add_mark(record: Record, judge: str | None, protocol: str, marks: Marks, words: str | None) -> None:
    """Add the answer to an open question as the judge gets it, and its mark and score.

    Args:
        record: The record of an answer.
        judge: The name of the judge.
        protocol: ``upstream`` or ``tolerant``.
        marks: The marks of the judge by the words of the question and the answer; ``None`` if its reply has no mark.
        words: What the judge is told of the question.
    """
    predicted = None if record["failure"] else judged_answer(record, protocol)
    mark = None if predicted is None else marks.get((words, predicted))
    if record["failure"]:
        outcome = "failed"
    elif predicted is None:
        outcome = "null"
    elif mark is not None:
        outcome = "marked"
    else:
        outcome = "unmarked" if (words, predicted) in marks else "unjudged"
    # An answer that is null scores 0 without a judge.
    points = {"marked": mark, "null": 1}.get(outcome)
    record.update(
        scene=record["episode"],
        frame=record["episode"],
        family=record["category"],
        predicted=predicted,
        outcome=outcome,
        judge=judge if outcome in ("marked", "unmarked") else None,
        mark=mark,
        score=None if points is None else (min(max(points, 1), 5) - 1) / 4,
    )
    record.setdefault("person", None)


def judged_answer(record: Record, protocol: str) -> str | None:
    """The answer in a reply to an open question, as the judge gets it; ``None`` if the reply has none.

    The rules are those of ``src/job/predictions.rs`` and ``src/score/llm_match.rs``.
    """
    reply = record["reply"]
    if reply is None or record["refusal"] is not None or not reply.strip():
        return None
    answer: str | None = reply
    if record["view"] == "blind":
        _, cue, behind = reply.partition("A:")
        if cue:
            answer = behind.split("\n")[0].replace("A:", "").strip()
        else:
            answer = reply.strip() if protocol == "tolerant" else None
    if answer is not None and protocol == "upstream":
        # What stands after the last full stop may be a truncated sentence.
        end = answer.rfind(".") + 1
        answer = answer[:end] or answer
    return answer


def add_reply(record: Record) -> None:
    """Add the fields of nested objects as columns of their own."""
    if isinstance(record["finish"], dict):
        record["finish"] = record["finish"]["other"]
    record.setdefault("via", "direct")
    failure = record["failure"] or {"kind": None, "status": None, "message": None}
    record.update((f"failure_{name}", value) for name, value in failure.items())
    usage = record["usage"] or {}
    record.update((name, usage.get(name)) for name in ("prompt_tokens", "completion_tokens", "cached_tokens"))
    record.setdefault("provider", None)
    record.setdefault("endpoint", None)
    sent = record["images"] if "images" in record else record["image"]
    for name in ("digest", "bytes", "width", "height", "format"):
        record[f"image_{name}"] = sent and sent[name]
    record["image_count"] = sent and sent.get("images")


def darkness(record: Record) -> tuple[float, str, str, str]:
    """The place of a record's condition among all: no image first, then from light to dark, each before its enhanced ones."""
    amount = record["ev"] if record["ev"] is not None else record.get("severity", -1.0)
    return amount, record["variant"], record["reading"] or "", record["enhancer"] or ""
