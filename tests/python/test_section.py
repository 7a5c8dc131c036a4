"""Pairs (x, y) of a section whose area form is not dq dp."""

import numpy as np
import pytest

import gyroceptron


def write_section(path, density):
    x, y = np.linspace(-1, 1, 41), np.linspace(-1.2, 1.2, 41)
    np.savez(path, x=x, y=y, density=density(*np.meshgrid(x, y)))


def pairs():
    """Of a turn by an angle that falls with the radius, in q = y and p = x + x^2/8: rho = 1 + x/4."""
    q, p = np.random.default_rng(1).uniform(-0.6, 0.6, (2, 400))
    angle = 0.7 - 0.2 * (q**2 + p**2)
    turned = q * np.cos(angle) + p * np.sin(angle), p * np.cos(angle) - q * np.sin(angle)
    return [np.stack([4 * (np.sqrt(1 + p / 2) - 1), q], 1) for q, p in [(q, p), turned]]


def test_a_section_is_charted(tmp_path):
    path = tmp_path / "density.npz"
    write_section(path, lambda x, y: 1 + x / 4)
    before, after = pairs()
    small = dict(kicks=(2, 1, 4), twists=(1, 1, 3), starts=1, iterations=30)
    model = gyroceptron.train(before, after, [1], section=path, **small)
    assert any("of a section" in note for note in model.notes)
    assert not any("do not keep" in note for note in model.notes)
    found = model.predict(before, 1)[-1]
    assert np.abs(found - after).max() < 1e-3
    assert np.abs(model.inverse(found) - before).max() < 1e-12
    determinants = np.linalg.det(model.jacobian(before))
    flux = determinants * (1 + found[:, 0] / 4) / (1 + before[:, 0] / 4)
    assert np.abs(flux - 1).max() < 1e-12
    model.save(tmp_path / "model.json")
    again = gyroceptron.load(tmp_path / "model.json")
    assert again == model
    assert (again.predict(before, 1)[-1] == found).all()
    with pytest.raises(gyroceptron.Error, match="points of the section"):
        model.predict(np.array([2.0, 0.0]), 1)


def test_another_density_is_told(tmp_path):
    path = tmp_path / "density.npz"
    write_section(path, lambda x, y: np.ones_like(x))
    before, after = pairs()
    small = dict(kicks=(2, 1, 4), twists=(1, 1, 3), starts=1, iterations=1)
    for given in (dict(section=path), dict()):
        with pytest.warns(UserWarning, match="do not keep"):
            with_notes = gyroceptron.train(before, after, [1], **given, **small)
        assert any("do not keep" in note for note in with_notes.notes)


def test_a_density_that_is_not_positive_is_refused(tmp_path):
    path = tmp_path / "density.npz"
    write_section(path, lambda x, y: x)
    with pytest.raises(gyroceptron.Error, match="positive"):
        gyroceptron.train(*pairs(), [1], section=path)
