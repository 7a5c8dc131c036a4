"""Pairs that depend on controls in, a model that takes values between them out, with exact derivatives."""

import pickle

import numpy as np
import pytest

import gyroceptron

VALUES = np.array([-1.0, -0.7, -0.4, 0.0, 0.3, 0.6, 1.0])
OPTIONS = dict(circle_action=[1], kicks=(4, 1, 4), twists=(1, 1, 3), perturbation=(4, 1, 4), starts=1, iterations=40)


def image(points, value):
    """A turn by an angle that depends on a control, and a kick by a polynomial whose strength does."""
    angle = 0.6 + 0.05 * value
    p = points[:, 1] - (0.1 + 0.02 * value) * points[:, 0] ** 2
    return np.stack(
        [np.cos(angle) * points[:, 0] + np.sin(angle) * p, -np.sin(angle) * points[:, 0] + np.cos(angle) * p], axis=1
    )


def pairs(values=VALUES):
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (50 * len(values), 2))
    of = np.repeat(values, 50)
    return points, image(points, of), of


@pytest.fixture(scope="module")
def model():
    z, w, values = pairs()
    return gyroceptron.train(z, w, controls={"coil": values}, **OPTIONS)


def test_a_model_takes_values_of_its_controls(model):
    assert model.controls == {"coil": (-1.0, 1.0)}
    assert any("coil from -1 to 1" in note for note in model.notes)
    points = np.random.default_rng(5).uniform(-0.3, 0.3, (20, 2))
    for value in (-0.85, 0.1, 0.45):
        at = model.at(coil=value)
        assert at.controls == {} and at.trust is None
        error = np.abs(at.predict(points)[1] - image(points, value)).max()
        assert error < 1e-3 < 10 * np.abs(model.predict(points)[1] - image(points, value)).max()
    assert (model.at(coil=0.0).predict(points) == model.predict(points)).all()
    assert pickle.loads(pickle.dumps(model)) == model
    with pytest.warns(UserWarning, match="outside of what the model has learnt"):
        model.at(coil=1.5)


def test_derivatives_are_those_of_differences(model):
    points = np.random.default_rng(6).uniform(-0.3, 0.3, (4, 5, 2))
    h = 1e-3

    def slope(of):
        return (8 * (of(h) - of(-h)) - (of(2 * h) - of(-2 * h))) / (12 * h)

    exact = model.control_derivatives(points, coil=0.2)
    assert exact.shape == (4, 5, 2, 1)
    flat = points.reshape(-1, 2)
    by_differences = slope(lambda by: model.at(coil=0.2 + by).predict(flat)[1]).reshape(4, 5, 2)
    assert np.abs(exact[..., 0] - by_differences).max() < 1e-10
    orbit = model.orbit_response([0.0, 0.0], coil=0.2)
    with pytest.raises(gyroceptron.Error, match="orbit of period 1"):
        model.orbit_response([0.0, 0.0], 3, coil=0.2)
    there = [slope(lambda by, k=k: model.at(coil=0.2 + by).periodic_orbits(orbit["points"])[0]["points"][0][k]) for k in (0, 1)]
    assert np.abs(orbit["moved"][:, 0] - there).max() < 1e-8
    trace = slope(lambda by: model.at(coil=0.2 + by).periodic_orbits(orbit["points"])[0]["trace"])
    assert orbit["trace_by"][0] == pytest.approx(trace, abs=1e-8)
    centre = orbit["points"][0]
    turns, changes = model.rotation_response((0.1, 0.0), tuple(centre), 4000, coil=0.2)

    def turning(by):
        states = model.at(coil=0.2 + by).predict([0.1, 0.0], steps=4000)
        return gyroceptron.rotation_number(states, tuple(centre), turns)[0]

    assert turns == pytest.approx(turning(0.0), abs=1e-9)
    assert changes[0] == pytest.approx(slope(turning), abs=1e-8)


def test_an_optimiser_finds_a_control(model):
    """Newton's method with the exact derivative, for a wanted trace of the fixed point: that of the map in closed form."""
    optimise = pytest.importorskip("scipy.optimize", reason="SciPy is not there")
    wanted = 2 * np.cos(0.6 + 0.05 * 0.35)

    def missed(value):
        found = model.orbit_response([0.0, 0.0], coil=float(value[0]))
        return [found["trace"] - wanted], [[found["trace_by"][0]]]

    found = optimise.root(missed, [0.0], jac=True)
    assert found.success and found.x[0] == pytest.approx(0.35, abs=2e-2)


def test_what_cannot_be_is_refused(model):
    z, w, values = pairs()
    for controls, words in [
        ({"coil": values[:-1]}, "coil"),
        ({"coil": np.full(len(z), np.nan)}, "coil"),
        ({"coil": np.zeros(len(z))}, "from 0 to 0"),
        ({"co=il": values}, "co=il"),
        ({"coil": np.zeros((len(z), 2))}, "shape"),
        ({}, "controls"),
    ]:
        with pytest.raises(gyroceptron.Error, match=words):
            gyroceptron.train(z, w, controls=controls, **OPTIONS)
    with pytest.raises(gyroceptron.Error, match="lambda"):
        gyroceptron.train(z, w, control_degree=2, **OPTIONS)
    with pytest.raises(gyroceptron.Error, match="one of coil"):
        model.at(ring=1.0)
    with pytest.raises(gyroceptron.Error, match="depends on no controls"):
        model.at(coil=0.0).at(coil=0.0)
    with pytest.raises(gyroceptron.Error, match="coil"):
        model.at(coil=float("nan"))
