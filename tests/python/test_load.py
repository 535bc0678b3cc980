"""`load_run`: its counts are those of the program's own tables."""

import json
import shutil
import unittest
import warnings
from pathlib import Path
from unittest import mock

import pandas
from darkqa_eval import load_run
from support import REFERENCE, RunTest, read_lines, summary

SUBJECT = ["model", "view", "level", "variant", "enhancer", "reading"]


def subjects(table):
    """The rows of each model in each condition, by the words of `summary.csv`."""
    keys = table[SUBJECT].astype(object).where(table[SUBJECT].notna(), "")
    yield from table.groupby([keys[name] for name in SUBJECT], sort=False)


def accuracy_rows(table):
    """The counts that `summary.csv` should have, made from a table of trials."""
    counts = {}
    for key, rows in subjects(table):
        families = {name: rows[rows["family"] == name] for name in rows["family"].unique()}
        for family, of_family in {"all": rows, **families}.items():
            for mode, suffix in (("strict", ""), ("lenient", "_lenient")):
                replies = of_family[of_family["right" + suffix].notna()]
                counts[(*key, family, mode)] = {
                    "n": len(replies),
                    "right": int(replies["right" + suffix].sum()),
                    "unparsed": int(replies["predicted" + suffix].isna().sum()),
                    "failed": int((of_family["outcome"] == "failed").sum()),
                    "always": replies.groupby("question")["right" + suffix].all().mean(),
                }
    return counts


class Choices(RunTest):
    def check(self, run, table):
        """Compare the counts of a table of trials with the `summary.csv` of a run; return the number of rows compared."""
        # The control of the observer has a table of its own, observer.csv.
        counts = accuracy_rows(table[table["model"] != "observer:other-room"])
        rows = [row for row in summary(run) if row["model"] != "chance"]
        for row in rows:
            found = counts.pop((*(row[name] for name in SUBJECT), row["family"], row["mode"]))
            for name in ("n", "right", "unparsed", "failed"):
                self.assertEqual(found[name], int(row[name]), (name, row))
            if row.get("always"):
                self.assertAlmostEqual(found["always"], float(row["always"]), msg=str(row))
        self.assertEqual(counts, {}, "the table has subjects that summary.csv has not")
        return len(rows)

    def test_reference(self):
        table = load_run(REFERENCE)
        self.assertEqual(self.check(REFERENCE, table), 36)
        self.assertEqual(list(table["level"].cat.categories), ["L0", "L3"])
        self.assertEqual(list(table["condition"].cat.categories), ["L0", "L3-ev", "L3-noise"])
        self.assertTrue(table["level"].cat.ordered and (table["level"].max(), table["ev"].max()) == ("L3", 6.0))
        self.assertEqual(list(table["outcome"].cat.categories), ["right", "wrong", "answered", "unparsed", "failed"])
        questions = {line["id"]: line for line in read_lines(REFERENCE / "questions.jsonl")}
        for row in table.itertuples():
            question = questions[row.question]
            self.assertEqual((row.text, row.scene, row.answer), (question["question"], question["scene"], question["answer"]))
            self.assertEqual((row.predicted == row.answer, row.choices[row.truth]), (row.right, row.answer))
        self.assertEqual(list(dict.fromkeys(table["question"])), list(questions))

    def test_types(self):
        """The types are the same whether a column has values or not."""
        types = {name: str(kind) for name, kind in load_run(REFERENCE).dtypes.items()}
        expected = {
            "string": ["key", "question", "text", "scene", "predicted", "failure_message", "image_digest"],
            "category": ["model", "condition", "level", "variant", "enhancer", "family", "outcome"],
            "Int16": ["truth", "strict", "lenient", "repeat", "choice_count", "failure_status"],
            "Int64": ["prompt_tokens", "completion_tokens", "cached_tokens", "latency_ms", "image_bytes", "image_width"],
            "boolean": ["right", "right_lenient"],
            "float64": ["ev"],
        }
        for kind, names in expected.items():
            self.assertEqual({types[name] for name in names}, {kind}, names)
        shutil.copytree(REFERENCE, self.folder / "empty", ignore=shutil.ignore_patterns("figures"))
        (self.folder / "empty" / "records.jsonl").write_text("")
        empty = load_run(self.folder / "empty")
        self.assertEqual((len(empty), {name: str(kind) for name, kind in empty.dtypes.items()}), (0, types))

    def test_what_few_servers_state(self):
        """Cached tokens, the provider and the replica are columns, missing where the record has none."""
        shutil.copytree(REFERENCE, self.folder / "run", ignore=shutil.ignore_patterns("figures"))
        records = read_lines(REFERENCE / "records.jsonl")[:2]
        records[0] |= {"provider": "a", "endpoint": 1}
        records[0]["usage"] = {"prompt_tokens": 9, "completion_tokens": 1, "cached_tokens": 4}
        self.write_lines("run/records.jsonl", records)
        table = load_run(self.folder / "run").set_index("key")
        stated = table.loc[records[0]["key"]]
        self.assertEqual((stated["cached_tokens"], stated["provider"], stated["endpoint"]), (4, "a", 1))
        self.assertTrue(table.loc[records[1]["key"], ["cached_tokens", "provider", "endpoint"]].isna().all())

    def test_repeats_failures_and_blind_models(self):
        self.call("rooms --out rooms --frames 3 --size 96x64")
        self.call("questions rooms --out rooms/questions.jsonl")
        questions = read_lines(self.folder / "rooms" / "questions.jsonl")
        replies = ["A", "I think it is {answer}.", "I cannot say."]
        script = [
            {"question": question["id"], "reply": replies[number % 4].format(**question)}
            for number, question in enumerate(questions)
            if number % 4 < 3
        ]
        self.write_lines("script.jsonl", script)
        models = "--model random --model script:script.jsonl --blind-model random"
        self.call(f"{models} --data rooms --levels L0,L3,E3.3 --repeats 2 --circular --out run", code=1)
        table = load_run(self.folder / "run")
        self.assertGreater(self.check(self.folder / "run", table), 50)
        failed = table[table["outcome"] == "failed"]
        self.assertGreater(len(failed), 10)
        self.assertEqual(set(failed["failure_kind"]), {"request"})
        self.assertTrue(failed["right"].isna().all() and failed["failure_message"].str.contains("script.jsonl").all())
        lenient = table[table["predicted"].isna() & table["predicted_lenient"].notna()]
        self.assertGreater(len(lenient), 10)
        self.assertEqual(set(table["repeat"]), {0, 1})
        self.assertEqual(list(table["level"].cat.categories), ["L0", "E3.3", "L3"])
        blind = table[table["view"] == "blind"]
        self.assertTrue(blind["condition"].isna().all() and blind["ev"].isna().all() and blind["image_digest"].isna().all())

    def test_the_last_complete_line_of_a_trial_counts(self):
        run = self.folder / "run"
        shutil.copytree(REFERENCE, run, ignore=shutil.ignore_patterns("figures"))
        records = read_lines(run / "records.jsonl")
        again = dict(records[0], outcome="failed", strict=None, lenient=None, reply=None, finish=None)
        again["failure"] = {"kind": "server", "status": 503, "message": "busy"}
        with (run / "records.jsonl").open("a") as file:
            file.write(json.dumps(again) + "\n" + json.dumps(records[1])[:-40])
        with self.assertWarnsRegex(UserWarning, rf"records.jsonl:{len(records) + 2}: the last line is incomplete"):
            table = load_run(run).set_index("key")
        self.assertEqual(len(table), len(records))
        row = table.loc[again["key"]]
        self.assertEqual((row["outcome"], row["failure_status"], row["failure_kind"]), ("failed", 503, "server"))
        self.assertEqual(table.loc[records[1]["key"]]["outcome"], records[1]["outcome"])

    def test_without_true_answers_no_reply_is_right_or_wrong(self):
        self.call("--model random --ask home --ask-per-image 2 --levels L0,L2 --data rooms:frames=6,size=96x64 --out run")
        table = load_run(self.folder / "run")
        self.assertEqual(set(table["outcome"]), {"answered"})
        self.assertTrue(table["right"].isna().all() and table["truth"].isna().all() and table["answer"].isna().all())
        self.assertTrue(table["predicted"].notna().all())

    def test_shards(self):
        trials = "--model random --blind-model random --levels L0,L2 --data rooms:frames=6,size=96x64 --out"
        self.call(f"{trials} whole")
        for shard in ("1/3", "2/3", "3/3"):
            self.call(f"{trials} parts --shard {shard}")
        whole, parts = self.folder / "whole", self.folder / "parts"
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table = load_run(parts)
        pandas.testing.assert_frame_equal(table.drop(columns="latency_ms"), load_run(whole).drop(columns="latency_ms"))
        self.check(whole, table)

        shutil.rmtree(parts / "shard-2-of-3")
        with self.assertWarnsRegex(UserWarning, r"shards are missing: \[2\] of 3"):
            self.assertLess(len(load_run(parts)), len(table))
        shutil.copytree(parts / "shard-1-of-3", parts / "copy")
        with self.assertRaisesRegex(ValueError, "a shard is there twice"):
            load_run(parts)
        shutil.rmtree(parts / "copy")
        self.call(f"{trials} parts/other --shard 2/3 --seed 9")
        shutil.move(parts / "other" / "shard-2-of-3", parts / "shard-2-of-3")
        shutil.rmtree(parts / "other")
        with self.assertRaisesRegex(ValueError, "shard-2-of-3 is a shard of another run than shard-1-of-3"):
            load_run(parts)
        shutil.rmtree(parts / "shard-2-of-3")
        shutil.copytree(whole, parts / "whole")
        with self.assertRaisesRegex(ValueError, "whole in it is no shard.*pandas.concat"):
            load_run(parts)

    def test_without_questions(self):
        run = self.folder / "run"
        shutil.copytree(REFERENCE, run, ignore=shutil.ignore_patterns("figures"))
        (run / "questions.jsonl").unlink()
        table = load_run(run, questions=False)
        full = load_run(REFERENCE)
        self.assertEqual(set(full) - set(table), {"scene", "text"})
        pandas.testing.assert_frame_equal(
            table.sort_values("key", ignore_index=True), full[list(table)].sort_values("key", ignore_index=True)
        )
        with self.assertRaisesRegex(FileNotFoundError, "questions.jsonl"):
            load_run(run)
        questions = (REFERENCE / "questions.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
        (run / "questions.jsonl").write_text("".join(questions[1:]), encoding="utf-8")
        with self.assertRaisesRegex(ValueError, "is not in questions.jsonl.*questions=False"):
            load_run(run)

    def test_errors_name_the_place_and_the_remedy(self):
        run = self.folder / "run"
        with self.assertRaisesRegex(FileNotFoundError, r"run: no such folder.*--out"):
            load_run(run)
        run.mkdir()
        with self.assertRaisesRegex(ValueError, "neither a run nor a folder of shards"):
            load_run(run)
        manifest = json.loads((REFERENCE / "manifest.json").read_text(encoding="utf-8"))
        manifest["schema"] = "darkqa.run/1"
        (run / "manifest.json").write_text(json.dumps(manifest))
        with self.assertRaisesRegex(ValueError, r"schema 'darkqa.run/1': load it with version 0"):
            load_run(run)
        (run / "manifest.json").write_text("{}")
        with self.assertRaisesRegex(ValueError, "not the manifest of a run"):
            load_run(run)
        shutil.copy(REFERENCE / "manifest.json", run)
        shutil.copy(REFERENCE / "questions.jsonl", run)
        for line, problem in (("{}", "KeyError"), ("[]", "AttributeError")):
            (run / "records.jsonl").write_text(f"{line}\n")
            with self.assertRaisesRegex(ValueError, f"records.jsonl:1: not a record of darkqa.run/2: {problem}"):
                load_run(run)
        (run / "records.jsonl").write_text("{\n")
        with self.assertRaisesRegex(ValueError, r"records.jsonl:1: not a line of JSON"):
            load_run(run)
        with mock.patch.dict("sys.modules", pandas=None), self.assertRaises(ImportError) as raised:
            load_run(REFERENCE)
        self.assertIn('pip install pandas', str(raised.exception))


class OpenQuestions(RunTest):
    def test_answers_marks_and_scores(self):
        self.call("rooms --out rooms --frames 2 --size 96x64")
        images = sorted(Path(self.folder, "rooms").glob("scenes/*/rgb/*.png"))
        self.assertEqual(len(images), 2)
        for walk in ("hm3d-v0/000-a", "scannet-v0/001-b"):
            folder = self.folder / "walks" / walk
            folder.mkdir(parents=True)
            for number, image in enumerate(images):
                shutil.copy(image, folder / f"{number:05}-rgb.png")
        walks = ["hm3d-v0/000-a", "hm3d-v0/000-a", "scannet-v0/001-b", "scannet-v0/001-b"]
        categories = ["attribute recognition", "object localization", "world knowledge", "world knowledge"]
        questions = [
            {"question_id": f"q{number}", "question": "What?", "answer": "brown", "category": category, "episode_history": walk}
            for number, (walk, category) in enumerate(zip(walks, categories))
        ]
        (self.folder / "questions.json").write_text(json.dumps(questions))
        # q0: an answer that is cut; q1: an empty one; q2: a mark that only the tolerant protocol reads; q3: fails at L2.
        answers = [("q0", "It is brown. It al"), ("q1", " "), ("q2", "perhaps")]
        script = [{"question": question, "reply": reply} for question, reply in answers]
        self.write_lines("answers.jsonl", [*script, {"question": "q3", "condition": "L0", "reply": "no. 5"}])
        self.write_lines("blind.jsonl", [{"question": "q0", "reply": "Q: x\nA: brown. A: and\nmore"}, {"default": "no idea"}])
        marks = [{"question": "q0", "reply": "5"}, {"question": "q2", "reply": "**4**"}, {"default": "Your mark: 2"}]
        self.write_lines("judge.jsonl", marks)
        people = [{"question_id": "q0", "answer": "red", "annotator": 1}, {"question_id": "q0", "answer": None, "annotator": 2}]
        (self.folder / "people.json").write_text(json.dumps(people))
        asked = (
            "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 48 --levels L0,L2 --out run "
            "--model script:answers.jsonl --blind-model script:blind.jsonl --answers human=people.json"
        )
        self.call(asked, code=1)
        table = self.check("unjudged")
        self.assertEqual(set(table["outcome"]), {"unjudged", "null", "failed"})
        self.call(f"{asked} --judge script:judge.jsonl", code=1)
        upstream = self.check("upstream")
        outcomes = {"marked": 5, "null": 6, "unmarked": 2, "failed": 1}
        self.assertEqual(upstream["outcome"].value_counts().to_dict(), {**outcomes, "unjudged": 0})
        self.call(f"{asked} --judge script:judge.jsonl --protocol tolerant", code=1)
        tolerant = self.check("tolerant")
        self.assertEqual(tolerant.loc[(tolerant["question"] == "q2") & (tolerant["level"] == "L2"), "mark"].tolist(), [4])
        self.assertEqual(set(tolerant["judge"].dropna()), {"script:judge.jsonl"})
        self.assertEqual(tolerant["image_count"].dropna().unique().tolist(), [2])
        self.assertEqual(set(tolerant["person"].dropna()), {"1", "2"})
        self.assertEqual(set(tolerant["text"]) | set(tolerant["answer"]), {"What?", "brown"})
        self.assertEqual(set(tolerant["scene"]), set(walks))
        left_out = set(tolerant) - set(load_run(self.folder / "run", questions=False))
        self.assertEqual(left_out, {"text", "answer"})
        # Another judge, who gives other marks, and fails on one answer.
        self.write_lines("strict.jsonl", [{"question": "q0", "reply": "1"}, {"question": "q2", "reply": "2"}])
        self.call(f"{asked} --judge script:strict.jsonl", code=1)
        strict = self.check("another judge")
        self.assertEqual(set(strict["mark"].dropna()), {1, 2})
        self.assertEqual(strict["outcome"].value_counts()["unjudged"], 1)
        # A reply that the server refused is no answer.
        records = read_lines(self.folder / "run" / "records.jsonl")
        refused = next(record for record in records if record["question"] == "q0" and record["level"] == "L2")
        self.write_lines("run/records.jsonl", [*records, {**refused, "refusal": "I cannot help with this."}])
        self.call("report run")
        self.assertEqual(self.check("refused")["outcome"].value_counts()["null"], outcomes["null"] + 1)

    def check(self, name):
        """Compare the table of the run with its `summary.csv`."""
        run = self.folder / "run"
        table = load_run(run)
        counts = {}
        for key, rows in subjects(table):
            families = {family: rows[rows["family"] == family] for family in rows["family"].unique()}
            for group, of_group in {"all": rows, **families}.items():
                outcomes = of_group["outcome"].value_counts()
                counts[(*key, group)] = {
                    "due": len(of_group),
                    "n": int(of_group["score"].notna().sum()),
                    "missing": outcomes["failed"],
                    **{outcome: outcomes[outcome] for outcome in ("unjudged", "unmarked", "null")},
                    "value": of_group["score"].mean(),
                }
        # People were not asked about every category.
        rows = [row for row in summary(run) if row["by"] != "split" and row["due"] != "0"]
        for row in rows:
            found = counts.pop((*(row[column] for column in SUBJECT), row["group"]))
            value = found.pop("value")
            self.assertEqual(found, {column: int(row[column]) for column in found}, (name, row))
            if row["value"]:
                self.assertAlmostEqual(value, float(row["value"]), msg=str(row))
            else:
                self.assertTrue(pandas.isna(value), row)
        self.assertEqual(counts, {}, name)
        return table


if __name__ == "__main__":
    unittest.main()
