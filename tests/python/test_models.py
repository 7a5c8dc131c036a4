"""Models as values: copies, pickles, equality, what they know of their training."""

import copy
import pickle

import numpy as np
import pytest

import gyroceptron


def small(pairs, **options):
    options = {"epsilon": 0.05, "iterations": 30, "psi": (1, 2), "near_identity": (1, 2), **options}
    return gyroceptron.train(*pairs, [1, 0], **{"recipe": "paper", **options})


def test_models_are_copied_and_pickled(tmp_path, pairs, model):
    large = small([128 * half for half in pairs])
    assert large.units is not None
    path = tmp_path / "model.json"
    large.save(path)
    for own in (model, large, gyroceptron.load(path)):
        copies = [copy.copy(own), copy.deepcopy(own), copy.deepcopy([own, own])[0]]
        copies += [pickle.loads(pickle.dumps(own, protocol)) for protocol in range(6)]
        points = np.array(own.region[1]) * [[0.3], [-0.2]]
        for other in copies:
            assert other == own and hash(other) == hash(own)
            assert other.parameters.tobytes() == own.parameters.tobytes()
            assert other.predict(points, 5).tobytes() == own.predict(points, 5).tobytes()
            for name in ("kind", "region", "units", "validation", "trust", "history", "notes"):
                assert getattr(other, name) == getattr(own, name), name
            other.save(tmp_path / "again.json", overwrite=True)
            own.save(tmp_path / "own.json", overwrite=True)
            assert (tmp_path / "again.json").read_bytes() == (tmp_path / "own.json").read_bytes()
    broken = pickle.dumps(model).replace(b'"seed": 4', b'"seed": "')
    with pytest.raises(gyroceptron.Error, match="pickled model"):
        pickle.loads(broken)


def test_equal_models_are_the_same_map(tmp_path, pairs, model):
    path = tmp_path / "model.json"
    model.save(path)
    loaded = gyroceptron.load(path)
    assert loaded == model and not loaded != model and hash(loaded) == hash(model)
    others = [small(pairs), small(pairs, seed=1), small([2 * half for half in pairs], units="data")]
    others += [small([128 * half for half in pairs]), model.at(epsilon=0.04)]
    for k, one in enumerate(others):
        assert one != model
        assert [one == other for other in others] == [k == j for j in range(len(others))]
    assert len({model, loaded, *others}) == 1 + len(others)
    assert model != "a model" and (model == 1) is False and model is not None


def test_parameters_cannot_be_written_to(model):
    parameters = model.parameters
    assert parameters.dtype == np.float64 and parameters.ndim == 1
    with pytest.raises(ValueError, match="read-only"):
        parameters[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        parameters *= 2
    changed = parameters.copy()
    changed[0] += 1.0
    assert not np.array_equal(changed, model.parameters)


def test_what_a_training_tells_stays_with_its_model(tmp_path, pairs, model):
    said = []
    report = tmp_path / "report"
    own = small(pairs, report=report, callback=lambda *record: said.append(record[1:]))
    assert [tuple(record.values()) for record in own.history][-len(said):] == said
    assert list(own.history[0]) == ["iteration", "loss", "held_out"]
    assert own.history[0]["iteration"] == 0 and own.history[-1]["iteration"] == 30
    assert min(r["held_out"] for r in own.history if r["held_out"] is not None) >= own.validation
    # The words of the report.
    text = (report / "report.md").read_text()
    assert f"**{own.trust['verdict']}**" in text
    assert all(reason in text for reason in own.trust["reasons"])
    assert own.trust["error"] in text and f"`{own.trust['next']}`" in text
    short = small(pairs, iterations=1)
    assert short.trust["verdict"] == "no" and short.trust["reasons"]
    assert model.trust["verdict"] != "no"

    path = tmp_path / "model.json"
    own.save(path)
    loaded = gyroceptron.load(path)
    assert loaded.trust is None and loaded.history is None and loaded.notes == []
    with pytest.warns(UserWarning, match="ε = 0.04 is outside of what the model has learnt"):
        other = own.at(epsilon=0.04)
    assert other.trust is None and other.history is None


@pytest.mark.parametrize("numbers", ["integers", "floats"])
def test_steps_back_on_a_grid_lead_to_the_first_state(model, numbers):
    points = np.array([[0.3, -0.2, 0.1, 0.4], [0.1, 0.2, -0.5, 0.0]])
    grid = {"grid": 40, "grid_numbers": numbers}
    there = model.predict(points, 500, every=500, **grid)
    assert abs(there[0] - points).max() <= 2.0**-41
    back = model.predict(there[-1], -500, every=500, **grid)
    assert back[0].tobytes() == there[-1].tobytes()
    assert back[-1].tobytes() == there[0].tobytes()
    plain = model.predict(model.predict(points, 500)[-1], -500)[-1]
    assert abs(plain - points).max() < 1e-9 and plain.tobytes() != points.tobytes()


def test_a_grid_that_does_not_do_is_refused(pairs, model):
    points = np.full((1, 4), 0.3)
    with pytest.raises(gyroceptron.Error, match="at most 62"):
        model.predict(points, grid=63)
    with pytest.raises(gyroceptron.Error, match="at most 50"):
        model.predict(points, grid=51, grid_numbers="floats")
    with pytest.raises(gyroceptron.Error, match="integers or floats"):
        model.predict(points, grid=40, grid_numbers="decimals")
    with pytest.raises(gyroceptron.Error, match="0 to 62 bits"):
        model.predict(points, grid=-1)
    with pytest.raises(gyroceptron.Error, match="an option of a grid"):
        model.predict(points, grid_numbers="floats")
    with pytest.raises(gyroceptron.Error, match="at least 1"):
        model.predict(points, 0)
    with pytest.warns(UserWarning, match="coarser than the grid"):
        model.predict(points * 3, 5, grid=60)
    twisted = gyroceptron.train(*pairs, [1, 0], epsilon=0.05, iterations=1)
    with pytest.raises(gyroceptron.Error, match="a twist"):
        twisted.predict(points, grid=40)
