"""Shapes, types and words of arguments."""

import pathlib
import re
import warnings

import numpy as np
import pytest

import gyroceptron

SOURCES = pathlib.Path(__file__).parents[2] / "src"


@pytest.mark.parametrize("leading", [(), (1,), (6,), (2, 3), (3, 1, 2)])
def test_points_have_any_leading_dimensions(pairs, model, leading):
    count = int(np.prod(leading))
    rows = 0.5 * pairs[0][:count]
    points = rows.reshape(*leading, 4)
    for name, last in [("inverse", (4,)), ("jacobian", (4, 4)), ("invariant", ())]:
        call = getattr(model, name)
        result = call(points)
        assert result.shape == (*leading, *last)
        assert np.array_equal(result, call(rows).reshape(result.shape))
    states = model.predict(points, steps=6, every=2)
    assert states.shape == (4, *leading, 4)
    assert np.array_equal(states, model.predict(rows, 6, 2).reshape(states.shape))
    assert np.array_equal(states[0], points)


def test_what_is_no_real_number_is_refused(pairs, model):
    points = pairs[0][:3]
    masked = np.ma.masked_greater(points, 0.5)
    unfit = [
        (masked, "masked"),
        (np.ma.masked_array(points), "masked"),
        ([masked[0], points[1]], "masked"),
        ([(0.0, np.ma.masked, 0.0, 0.0)], "masked"),
        (points + 1j, "complex128"),
        (points.astype(np.complex64), "complex64"),
        (points.astype(object), "dtype object"),
        (points.astype(str), "dtype <U"),
        ("0 0 0 0", "dtype <U"),
        (points.astype("timedelta64[s]"), "timedelta64"),
        (None, "dtype object"),
        ([[0.0, 0.0], [0.0]], "real numbers"),
    ]
    for wrong, word in unfit:
        for call in (model.predict, model.inverse, model.jacobian, model.invariant):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                with pytest.raises(gyroceptron.Error, match=word) as refused:
                    call(wrong)
            assert str(refused.value).startswith("points: ")
    with pytest.raises(gyroceptron.Error, match="input: .*masked"):
        gyroceptron.train(np.ma.masked_array(pairs[0]), pairs[1], [1, 0])
    with pytest.raises(gyroceptron.Error, match="output: .*complex"):
        gyroceptron.train(pairs[0], pairs[1] + 0j, [1, 0])
    with pytest.raises(gyroceptron.Error, match="output: .*3 dimensions"):
        gyroceptron.train(pairs[0], pairs[1][None], [1, 0])
    each = np.full(len(pairs[0]), 0.1)
    for name in ("epsilon", "flow_time", "loss_weights"):
        for wrong, word in [(each + 1j, "complex128"), (np.ma.masked_array(each), "masked"), (each[None], "shape")]:
            with pytest.raises(gyroceptron.Error, match=f"{name}: .*{word}"):
                gyroceptron.train(*pairs, [1, 0], **{name: wrong})
    for name, wrong in [("kicks", [3]), ("kicks", (2, [1, "many"])), ("ramp", [(1.0,)])]:
        with pytest.raises(TypeError, match=rf"expected .*, found \(.*\n.*'{name}'"):
            gyroceptron.train(*pairs, [1, 0], **{name: wrong})
    with pytest.raises(gyroceptron.Error, match="blocks: .*at least one"):
        gyroceptron.train(*pairs, [1, 0], blocks=[])
    bad = [{"layer": "twist", "widths": [2]}, {"layer": "twist", "widths": [2], "part": "conjugaton"}]
    with pytest.raises(gyroceptron.Error, match=r"block 1 \(`conjugaton`\): blocks: .*`conjugaton`") as refused:
        gyroceptron.train(*pairs, [1, 0], blocks=bad)
    assert "line 1" not in str(refused.value)
    with pytest.raises(gyroceptron.Error, match=r"points: row 1, column 2"):
        model.inverse([[[0, 0, 0, 0]], [[0, 0, np.inf, 0]]])
    whole = np.array([[0, 0, 1, 0]])
    for kind in (np.int8, np.uint64, np.float16, np.longdouble, ">f8", bool):
        assert np.array_equal(model.inverse(whole.astype(kind)), model.inverse(whole))


def test_circle_actions_are_whole_numbers_or_are_found(pairs):
    options = {"epsilon": 0.05, "iterations": 3, "psi": (1, 2), "near_identity": (1, 2)}

    def trained(action, pairs=pairs):
        return gyroceptron.train(*pairs, action, recipe="paper", **options)

    expected = trained([1, 0])
    for action in ([1.0, 0.0], np.array([1, 0]), np.array([1.0, 0.0]), (np.int8(1), 0), [[1, 0]], "auto"):
        assert trained(action) == expected
    plane = tuple(half[:, [0, 2]] for half in pairs)
    assert trained(1, plane) == trained([1], plane) == trained(np.float64(1), plane)
    [note] = trained("auto").notes
    assert note.startswith("circle action 1,0")
    assert not any("circle action" in note for note in expected.notes)
    for action, found in [
        ([0.5, 0], "0.5"), (0.25, "0.25"), ([1, float("nan")], "nan"), ([1, 10**30], "1000000"),
        ("best", "best"), ([1, "a"], "a"), ([1, 1 + 2j], "2j"), ([1, None], "None"),
        ([[1, 0], [0.5, 0]], "0.5"), ([1, [0]], "0"), (np.complex64(1 + 3j), "3j"),
    ]:
        with pytest.raises(gyroceptron.Error, match=re.escape(found)) as refused:
            trained(action)
        assert str(refused.value).startswith("circle_action: "), action
    # What stands still turns by no action.
    with pytest.raises(gyroceptron.Error, match="circle action: .*none for sure"):
        trained("auto", (pairs[0], pairs[0]))
    with pytest.raises(gyroceptron.Error, match="pairs"):
        trained("auto", (pairs[0][:2], pairs[1][:2]))


def test_another_reading_of_the_columns_is_a_warning(pairs):
    options = {"iterations": 1, "psi": (1, 2), "near_identity": (1, 2)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gyroceptron.train(*pairs, [1, 0], **{"recipe": "paper", **options})
    interleaved = [half[:, [0, 2, 1, 3]] for half in pairs]
    with pytest.warns(UserWarning, match="columns q1 p1 q2 p2 with circle action 1,0 better"):
        gyroceptron.train(*interleaved, [1, 0], recipe="paper", **options)


def test_pairs_that_no_such_map_has_are_a_warning(pairs):
    options = {"iterations": 1, "psi": (1, 2), "near_identity": (1, 2), "recipe": "paper"}
    before, after = pairs
    with pytest.warns(UserWarning, match="do not keep dq∧dp"):
        model = gyroceptron.train(before, 0.9 * after, [1, 0], **options)
    assert sum("do not keep" in note for note in model.notes) == 1
    with pytest.warns(UserWarning, match="have ε below 0"):
        model = gyroceptron.train(before, after, [1, 0], epsilon=np.where(before[:, 0] < 0, -0.05, 0.05), **options)
    assert sum("have ε below 0" in note for note in model.notes) == 1


def test_options_without_effect_are_refused(pairs):
    for option, message in [
        (dict(radius=1.5), "radius"),
        (dict(resume=True), "resume: expected a checkpoint"),
        (dict(iterations=0), "iterations: expected"),
    ]:
        with pytest.raises(gyroceptron.Error, match=message):
            gyroceptron.train(*pairs, **option)


def test_units_are_a_note(pairs):
    options = {"iterations": 1, "psi": (1, 2), "near_identity": (1, 2)}
    large = [128 * half for half in pairs]
    [note] = gyroceptron.train(*large, [1, 0], recipe="paper", **options).notes
    assert "units of" in note
    assert gyroceptron.train(*large, [1, 0], recipe="paper", units="data", **options).notes == []


def test_no_message_names_an_option_of_the_program(tmp_path, pairs, model):
    """Texts of the library are read in Python too."""
    report = tmp_path / "report"
    options = {"iterations": 1, "psi": (1, 2), "near_identity": (1, 2), "report": report}
    gyroceptron.train(*pairs, [1, 0], **{"recipe": "paper", **options})
    with pytest.raises(gyroceptron.Error, match="report") as refused:
        gyroceptron.train(*pairs, [1, 0], **{"recipe": "paper", **options})
    assert "--" not in str(refused.value)
    assert "--" not in (report / "report.md").read_text().split("## To repeat it")[0].replace("---", "")
    path = tmp_path / "model.json"
    model.save(path)
    with pytest.raises(gyroceptron.Error, match="overwrite=True") as refused:
        model.save(path)
    assert "--" not in str(refused.value)
    with pytest.raises(gyroceptron.Error, match="published-weights: .*; give weights=FILE") as refused:
        gyroceptron.run("published-weights", tmp_path / "out")
    assert "--" not in str(refused.value)
    for source in SOURCES.rglob("*.toml"):
        text = "".join(line.split("#")[0] for line in source.read_text().splitlines())
        assert not re.search(r"--[a-z]", text), source
    # Commands of the program that a report says, to repeat what it shows.
    commands = {"command.rs", "html.rs", "markdown.rs", "next_command.rs"}
    for source in SOURCES.rglob("*.rs"):
        if source.name in commands or source.is_relative_to(SOURCES / "cli"):
            continue
        for number, line in enumerate(source.read_text().splitlines()):
            code = line.split("//")[0]
            assert not re.search(r"--[a-z]", code), f"{source}:{number + 1}: {line}"
