"""Whatever one caller can, all can: the rows of tests/abilities.toml from Python, to the bits of the program.

tests/program/abilities.rs does them from Rust.
"""

import inspect
import json
import pathlib
import warnings

import numpy as np
import pytest

import gyroceptron
from conftest import flow

tomllib = pytest.importorskip("tomllib", reason="Python 3.10 reads no TOML")
TABLE = tomllib.loads((pathlib.Path(__file__).parents[1] / "abilities.toml").read_text())
ABILITIES = {row["name"]: row for row in TABLE["ability"]}


def arrays(columns=None, scale=1.0, epsilons=(), times=(), count=60):
    """The arrays of pairs, as the program reads them."""
    family = len(epsilons) + len(times) > 0
    parts = []
    for number, (epsilon, time) in enumerate((e, t) for e in epsilons or [0.05] for t in times or [0.7]):
        points = np.random.default_rng(number).uniform(-1, 1, (count, 4))
        parts.append((points, flow(points, epsilon, time), np.full(count, epsilon), np.full(count, time)))
    of = dict(zip(["input", "output", "epsilon", "flow_time"], map(np.concatenate, zip(*parts)), strict=True))
    for name in ("input", "output"):
        of[name] = scale * of[name][:, columns or [0, 1, 2, 3]]
    return of if family else {name: of[name] for name in ("input", "output")}


class Calls:
    """An ability as the program and as Python is asked for it, in a folder of its own."""

    def __init__(self, row, program):
        base = TABLE["from"][row.get("from", "small")]
        self.row, self.call = row, program
        self.options = base["program"] | row["program"]
        self.keywords = base["python"] | row["python"]
        self.arrays = arrays(**TABLE["pairs"][row.get("pairs", "plain")])
        np.savez("pairs.npz", **self.arrays)
        if "scene" in row:
            pathlib.Path("own.toml").write_text(row["scene"])

    def program(self, output="program.json", **more):
        """The bytes of the program's model, its notes and what it prints."""
        words = []
        for key, value in (self.options | more).items():
            words += [] if value is False else [f"--{key}"] if value is True else [f"--{key}", value]
        done = self.call("train", "--data", "pairs.npz", "--output", output, "--json", *words)
        lines = [line for line in done.stderr.splitlines() if not (line.startswith("training ") or line[-1:] == "…")]
        return pathlib.Path(output).read_bytes(), lines, json.loads(done.stdout)

    def value(self, value):
        if isinstance(value, str) and value.startswith("@"):
            return None if value == "@none" else self.arrays[value[1:]]
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return value
        return tuple(map(self.value, value)) if isinstance(value, list) else value

    def train(self, **more):
        """The model of Python, and its warnings."""
        keywords = {k: self.value(v) for k, v in (self.keywords | more).items() if v is not False}
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            model = gyroceptron.train(self.arrays["input"], self.arrays["output"], **keywords)
        return model, [str(warning.message) for warning in said]


def bytes_of(model):
    path = pathlib.Path("python.json")
    model.save(path, overwrite=True)
    return path.read_bytes()


@pytest.fixture
def calls(request, tmp_path, monkeypatch, program):
    monkeypatch.chdir(tmp_path)
    return Calls(ABILITIES[request.param], program)


def of_effect(*effects):
    names = [name for name, row in ABILITIES.items() if row.get("effect", "parameters") in effects]
    assert names
    return pytest.mark.parametrize("calls", names, indirect=True)


@of_effect("parameters", "model", "note", "stop", "report")
def test_python_gives_what_the_program_gives(calls):
    expected, lines, said = calls.program()
    # The report is where the program's was.
    if "report" in calls.keywords:
        pathlib.Path(calls.keywords["report"]).rename("of-program")
    model, warned = calls.train()
    assert bytes_of(model) == expected
    notes = model.notes
    assert len(notes) == len(lines), (notes, lines)
    for note in notes:
        assert sum(note in line for line in lines) == 1, (note, lines)
    words = calls.row.get("note")
    assert words is None or sum(words in note for note in notes) == 1
    about_pairs = ("better", "below 0", "do not keep", "revers", "mirror")
    assert warned == [note for note in notes if any(word in note for word in about_pairs)]
    report = pathlib.Path("of-program" if "report" in calls.keywords else "program-report")
    last = json.loads((report / "report.json").read_text())["studies"]["training"]["models"][0]["last"]
    assert model.history[-1]["iteration"] == last["iteration"]
    assert said["best"]["validation"] == model.validation
    if "report" in calls.keywords:
        own = pathlib.Path(calls.keywords["report"])
        assert {path.name for path in own.iterdir()} == {path.name for path in report.iterdir()}
        for name in ("report.json", "as-run.toml"):
            assert (own / name).read_bytes() == (report / name).read_bytes(), name


@of_effect("resume", "interrupt")
def test_a_checkpoint_is_gone_on_with(calls):
    whole = calls.program("whole.json", resume=False)[0]
    seen = []

    def stops(_, iteration, *__):
        seen.append(iteration)
        return iteration < 4

    if calls.row["effect"] == "resume":
        first, _ = calls.train(iterations=4, resume=False)
    else:
        first, _ = calls.train(callback=stops)
        assert seen == [1, 2, 3, 4]
    assert bytes_of(first) != whole and first.history[-1]["iteration"] == 4
    # The program goes on with it too.
    checkpoint = pathlib.Path(calls.keywords["checkpoint"])
    pathlib.Path("program.json.checkpoint").write_bytes(checkpoint.read_bytes())
    assert calls.program(resume=True)[0] == whole
    seen = []
    last, _ = calls.train(resume=True, callback=lambda _, iteration, *__: seen.append(iteration))
    assert bytes_of(last) == whole and seen[0] == 5


def test_every_keyword_is_one_of_an_ability():
    keywords = set(inspect.signature(gyroceptron.train).parameters)
    named = {keyword for row in ABILITIES.values() for keyword in row["python"]}
    exceptions = set(TABLE["exceptions"]["python"])
    assert named | exceptions == keywords and not named & exceptions
