"""What the README and the guide show, as it stands there."""

import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import gyroceptron

ROOT = pathlib.Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
CHAPTERS = [path.read_text() for path in sorted((ROOT / "src/guide").glob("*.md"))]


def blocks_of(text):
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


BLOCKS = [block for text in [README, *CHAPTERS] for block in blocks_of(text)]


def test_the_readme_trains_in_a_dozen_lines(capsys):
    [example] = blocks_of(README)
    assert len([line for line in example.splitlines() if line]) <= 12
    names = {}
    exec(example, names)
    assert capsys.readouterr().out.startswith("yes") and names["model"].validation < 1e-8
    assert names["orbits"].shape == (101, 8, 2)


def test_the_readme_is_short_and_its_links_lead_somewhere():
    lines = README.splitlines()
    assert len(lines) <= 200
    assert all(len(line) <= 120 for line in lines if not line.startswith("|"))
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", README)
    for link in [link for link in links if "://" not in link]:
        assert (ROOT / link).exists(), link
    assert len(set(links)) > 20


def test_the_example_trains_a_pendulum(capsys):
    [example] = [block for block in BLOCKS if "a pendulum of period" in block]
    names = {}
    exec(example, names)
    model = names["model"]
    assert "holds: " in capsys.readouterr().out
    assert model.validation < 1e-6
    assert names["orbits"].shape == (101, 8, 2)
    action = model.invariant(names["points"][:8])
    assert np.median(names["drift"] / action) < 0.1


def test_a_particle_is_followed_in_coordinates_that_are_made_canonical():
    [example] = [block for block in BLOCKS if "to_canonical" in block]
    names = {}
    exec(example, names)
    z, orbits = names["z"], names["orbits"]
    assert np.abs(names["from_canonical"](names["to_canonical"](z)) - z).max() < 1e-14
    assert names["fast"].error(names["before"], names["images"]) < 1e-7
    here = names["some"]
    for _ in range(1000):
        here = names["after"](here)
    assert np.abs(orbits[-1] - here).max() < 1e-4
    # As they are, the pairs are of no map that keeps dq dp.
    with pytest.raises(gyroceptron.Error, match="canonical coordinates"):
        gyroceptron.SymplecticPolynomial(z, names["after"](z), 9)


def test_field_lines_are_learnt_and_asked(tmp_path, monkeypatch):
    [example] = [block for block in BLOCKS if "FieldLines" in block]
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(example, names)
    exact = np.trace(names["lines"].jacobian(names["lines"].axis))
    assert abs(names["axis"]["trace"] - exact) < 1e-4
    assert abs(names["turns"] - names["lines"].turns) < 1e-3 and names["error"] < 1e-8
    assert names["circle"].error < 1e-6


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_the_reader_agrees_with_the_network(tmp_path, pairs, program, scale):
    [reader] = [block for block in BLOCKS if "def henon_inverse" in block]
    names = {}
    exec(reader, names)
    model = gyroceptron.train(
        scale * pairs[0], scale * pairs[1], [1, 0], recipe="paper", epsilon=0.05, iterations=40
    )
    assert (model.units is None) == (scale == 1.0)
    model.save(tmp_path / "model.json")
    program("export", "--model", tmp_path / "model.json", "--output", tmp_path / "w.npz")
    points = scale * pairs[0][:200]
    found = names["step"](tmp_path / "w.npz", points, [1, 0], 0.05)
    expected = model.predict(points, outside="ignore")[1]
    assert np.abs(found - expected).max() < 1e-14 * scale
    assert len(reader.splitlines()) <= 40


def test_the_docstrings_are_a_reference():
    done = subprocess.run(
        [sys.executable, "-c", "import gyroceptron; help(gyroceptron)"], capture_output=True, text=True
    )
    assert done.returncode == 0 and "train(" in done.stdout
