"""The recipes of `src/docs/pandas.md`: they run as they stand, and their numbers are those of the program's own tables."""

import contextlib
import csv
import importlib.util
import io
import os
import re
import unittest

import pandas
from darkqa_eval import load_run
from support import REPOSITORY, RunTest, read_lines, summary

PAGE = REPOSITORY / "src" / "docs" / "pandas.md"
SUBJECT = ["model", "view", "level", "variant", "enhancer", "reading"]


def blocks(language):
    """The fenced blocks of the page in a language: whether they are run, the lines above them, and their text."""
    text = PAGE.read_text(encoding="utf-8")
    for found in re.finditer(rf"^```{language}( no-run)?\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        yield not found[1], text.count("\n", 0, found.start(2)), found[2]


def rows(path, **values):
    """The rows of a CSV file that have these values."""
    with path.open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if all(row[name] == value for name, value in values.items())]


def condition(row):
    """The condition of a row of `summary.csv` without an enhancer."""
    return row["level"] if row["variant"] == "none" else f"{row['level']}-{row['variant']}"


def by_key(table):
    """The rows of a frame by its index, or those of a series; in the words of CSV files."""

    def words(key):
        return tuple("" if pandas.isna(value) else str(value) for value in key)

    items = table.items() if isinstance(table, pandas.Series) else table.iterrows()
    return {words(key): row for key, row in items}


class Recipes(RunTest):
    def run_blocks(self, language, least):
        """Run the blocks of the page in the test's folder, in one namespace; return that."""
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        names, count = {}, 0
        for is_run, above, text in blocks(language):
            # Empty lines above give an error the number of its line in the page.
            code = compile("\n" * above + text, str(PAGE), "exec")
            if is_run:
                count += 1
                with contextlib.redirect_stdout(io.StringIO()):
                    exec(code, names)
        self.assertGreaterEqual(count, least)
        return names

    def run_page(self):
        """Run the recipes of pandas."""
        names = self.run_blocks("python", 9)
        # A recipe that changes the table of trials would change the numbers of the next ones.
        loaded = load_run(self.folder / "runs" / "a")
        self.assertEqual(len(names["trials"]), (~loaded["model"].str.startswith("observer:")).sum())
        return names

    def check(self, names):
        """Compare the results of the page with the tables of `runs/a` and with `compared/baseline.csv`."""
        run = self.folder / "runs" / "a"
        self.check_accuracy(names, summary(run))
        self.check_differences(names, run / "comparisons.csv")
        self.check_two_runs(names, self.folder / "compared" / "baseline.csv")
        self.check_seeds(names["by_seed"], names["means"])

    def check_accuracy(self, names, table):
        table = [row for row in table if row["family"] == "all" and row["model"] != "chance"]
        strict = {tuple(row[name] for name in SUBJECT): row for row in table if row["mode"] == "strict"}
        accuracy = by_key(names["accuracy"].set_index(SUBJECT))
        self.assertEqual(set(accuracy), set(strict))
        always = by_key(names["always"])
        for key, row in strict.items():
            found = accuracy[key]
            self.assertEqual((found["n"], found["right"]), (int(row["n"]), int(row["right"])), key)
            self.assertAlmostEqual(found["accuracy"], float(row["value"]), msg=key)
            if row.get("always"):
                self.assertAlmostEqual(always[key], float(row["always"]), msg=key)
        for model, found in names["counts"].iterrows():
            of_model = [row for row in table if row["model"] == model]
            for mode in ("strict", "lenient"):
                of_mode = [row for row in of_model if row["mode"] == mode]
                sums = (sum(int(row[name]) for row in of_mode) for name in ("n", "right", "unparsed", "failed"))
                n, right, unparsed, failed = sums
                self.assertEqual((found["replies"], found["failed"], found["trials"]), (n, failed, n + failed), model)
                self.assertAlmostEqual(found[mode], right / n, msg=model)
                if mode == "strict":
                    self.assertEqual(found["unparsed"], unparsed, model)

    def check_differences(self, names, path):
        effects = by_key(names["effects"])
        differences = rows(path, kind="enhancer", family="all", mode="strict")
        self.assertEqual(set(effects), {(row["model"], row["condition"]) for row in differences})
        for row in differences:
            found = effects[row["model"], row["condition"]]
            same = [("n", "n"), ("difference", "difference"), ("only_enhanced", "only_first"), ("only_raw", "only_second")]
            for name, column in same:
                self.assertAlmostEqual(found[name], float(row[column]), msg=(name, row))
            self.assertTrue(-1 <= found["low"] <= found["difference"] <= found["high"] <= 1, found)
        darkness = rows(path, kind="level", condition="L5-noise", family="all", mode="strict")
        expected = {row["model"]: int(row["only_second"]) for row in darkness if row["only_second"] != "0"}
        self.assertGreater(len(expected), 0)
        self.assertEqual(names["lost"].astype({"model": object})["model"].value_counts().to_dict(), expected)

    def check_two_runs(self, names, path):
        compared = by_key(names["compared"])
        differences = [row for row in rows(path) if row["condition"] != "blind"]
        self.assertGreater(len(differences), 3)
        self.assertEqual(set(compared), {(row["model"], row["condition"]) for row in differences})
        for row in differences:
            found = compared[row["model"], row["condition"]]
            for name in ("n", "old", "new", "difference"):
                self.assertAlmostEqual(found[name], float(row[name]), msg=(name, row))

    def check_seeds(self, by_seed, means):
        self.assertEqual(list(by_seed.columns), [1, 2, 3])
        for seed in by_seed.columns:
            table = summary(self.folder / "runs" / f"seed-{seed}")
            expected = {
                (row["model"], condition(row)): row
                for row in table
                if row["family"] == "all" and row["mode"] == "strict" and row["level"] and row["model"] != "chance"
            }
            found = by_key(by_seed[seed])
            self.assertEqual(set(found), set(expected))
            for key, row in expected.items():
                self.assertAlmostEqual(found[key], float(row["value"]), msg=(seed, key))
        for key, row in by_key(means).items():
            self.assertAlmostEqual(row["difference"], by_seed.loc[key].mean(), msg=key)
            self.assertTrue(0 <= row["low"] <= row["difference"] <= row["high"] <= 1, row)

    @unittest.skipUnless(importlib.util.find_spec("polars"), "no polars")
    def test_polars_agrees_with_the_tables(self):
        data = "--data rooms:frames=6,size=96x64 --levels L0,L3"
        self.call(f"--model observer --model random --blind-model random --llie lift --out runs/a {data}")
        for seed in (1, 2, 3):
            self.call(f"--model random --seed {seed} --out runs/seed-{seed} {data}")
        names = self.run_blocks("python polars", 1)
        table = summary(self.folder / "runs" / "a")
        table = [row for row in table if row["family"] == "all" and row["mode"] == "strict" and row["model"] != "chance"]
        expected = {tuple(row[name] for name in SUBJECT): (int(row["n"]), float(row["value"])) for row in table}
        found = {tuple(row[name] or "" for name in SUBJECT): (row["n"], row["accuracy"]) for row in names["accuracy"].to_dicts()}
        self.assertEqual(set(found), set(expected))
        for key, (n, accuracy) in expected.items():
            self.assertEqual(found[key][0], n, key)
            self.assertAlmostEqual(found[key][1], accuracy, msg=key)
        differences = rows(self.folder / "runs" / "a" / "comparisons.csv", kind="enhancer", family="all", mode="strict")
        effects = {(row["model"], row["condition"]): row for row in names["effects"].to_dicts()}
        self.assertEqual(set(effects), {(row["model"], row["condition"]) for row in differences})
        for row in differences:
            effect = effects[row["model"], row["condition"]]
            self.assertEqual(effect["n"], int(row["n"]))
            self.assertAlmostEqual(effect["difference"], float(row["difference"]), msg=row)
        means = {row["condition"]: row["mean"] for row in names["means"].to_dicts()}
        values = {}
        for seed in (1, 2, 3):
            for row in rows(self.folder / "runs" / f"seed-{seed}" / "summary.csv", family="all", mode="strict", model="random"):
                values.setdefault(condition(row), []).append(float(row["value"]))
        self.assertEqual(set(means), set(values))
        for name, of_seeds in values.items():
            self.assertAlmostEqual(means[name], sum(of_seeds) / 3, msg=name)

    def test_on_the_runs_of_the_page(self):
        commands = "".join(text for is_run, _, text in blocks("sh") if is_run).splitlines()
        for command in commands:
            program, words = command.split(maxsplit=1)
            self.assertEqual(program, "darkqa-eval")
            self.call(words if words.startswith("report ") else f"{words} --data rooms:frames=12,size=96x64")
        names = self.run_page()
        self.check(names)
        # The noise of another seed is in other images.
        self.assertEqual({condition for _, condition in names["compared"].index if "noise" in condition}, set())

    def test_on_runs_with_all_kinds_of_replies(self):
        self.call("rooms --out rooms --frames 6 --size 96x64")
        self.call("questions rooms --out rooms/questions.jsonl")
        for name, shift in (("a", 0), ("b", 3)):
            self.write_script(f"{name}.jsonl", shift)
            model = f'[[model]]\nname = "gpt-4o"\nid = "script:{name}.jsonl"\nview = "both"\n'
            (self.folder / f"{name}.toml").write_text(model, encoding="utf-8")
            words = "--model random --data rooms --levels L0,L1,L5 --llie lift --repeats 2 --circular"
            self.call(f"--models {name}.toml {words} --out runs/{name}", code=1)
            self.add_usage(self.folder / "runs" / name / "records.jsonl")
            self.call(f"report runs/{name}")
        self.call("report runs/b --baseline runs/a --out compared")
        for seed in (1, 2, 3):
            self.call(f"--model random --data rooms --levels L0,L5 --seed {seed} --out runs/seed-{seed}")
        names = self.run_page()
        self.check(names)
        self.check_tokens(names)
        outcomes = names["trials"]["outcome"].value_counts()
        self.assertTrue(all(outcomes[name] > 20 for name in ("right", "wrong", "unparsed", "failed")), outcomes)
        self.assertGreater(len(rows(self.folder / "runs" / "a" / "summary.csv")[0]["always"]), 0)
        counts = names["counts"].loc["gpt-4o"]
        self.assertGreater(counts["lenient"], counts["strict"])

    def write_script(self, name, shift):
        """Replies to all questions in all conditions that are right, wrong, only readable leniently, unreadable, or missing."""
        conditions = ["L0"] + [f"{level}-{variant}" for level in ("L1", "L5") for variant in ("ev", "noise", "noise+lift")]
        lines = []
        for number, question in enumerate(read_lines(self.folder / "rooms" / "questions.jsonl")):
            answer = question["answer"]
            wrong = next(choice for choice in question["choices"] if choice != answer)
            replies = [answer, answer, wrong, f"I think it is {answer}.", "I cannot say.", None, answer]
            for place, condition in enumerate(conditions):
                reply = replies[(number * 2 + place * (3 + number % 2) + shift) % len(replies)]
                if reply is not None:
                    lines.append({"question": question["id"], "condition": condition, "reply": reply})
            # Of the others some are right at L0 and fail at L5-noise.
            if number % 7 != 3:
                lines.append({"question": question["id"], "reply": wrong if number % 3 else answer})
        self.write_lines(name, lines)

    def add_usage(self, path):
        """Write tokens into most records of the model with a price, as a server states them; some come from a batch."""
        records = read_lines(path)
        for record in records:
            number = int(record["key"], 16)
            if record["model"] == "gpt-4o" and record["reply"] is not None and number % 9:
                record["usage"] = {"prompt_tokens": 1000 + number % 50, "completion_tokens": 1 + number % 4}
                if number % 4 == 0:
                    record["via"] = "batch"
        self.write_lines(path, records)

    def check_tokens(self, names):
        records = [record for record in read_lines(self.folder / "runs" / "a" / "records.jsonl") if record["model"] == "gpt-4o"]
        for name in ("prompt_tokens", "completion_tokens"):
            stated = sum(record["usage"][name] for record in records if record["usage"])
            self.assertGreater(stated, 0)
            self.assertEqual(names["tokens"].loc["gpt-4o", name], stated)
        self.assertTrue(names["tokens"].loc["random"].isna().all())
        bill = names["bill"].astype({"condition": "string"}).fillna({"condition": "blind"})
        costs = bill.groupby(["model", "condition"])["dollars"].sum()
        reported = rows(self.folder / "compared" / "baseline.csv", model="gpt-4o")
        self.assertGreater(len(reported), 6)
        for row in reported:
            self.assertAlmostEqual(costs["gpt-4o", row["condition"]], float(row["cost_old"]), msg=row)


if __name__ == "__main__":
    unittest.main()
