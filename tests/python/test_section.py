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


def test_another_density_is_reported(tmp_path):
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


def two_planes():
    """Of turns of both planes by angles that depend on both radii; rho is 1 + x/4 in plane 1 and 1 + y/5 in plane 2."""
    q, p = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 600, 2))
    square = q**2 + p**2
    angle = np.array([0.7, 0.4]) - square @ np.array([[0.2, 0.1], [0.1, 0.15]])
    turned = q * np.cos(angle) + p * np.sin(angle), p * np.cos(angle) - q * np.sin(angle)
    of = lambda q, p: np.stack([4 * (np.sqrt(1 + p[:, 0] / 2) - 1), p[:, 1] / (1 + q[:, 1] / 5), q[:, 0], q[:, 1]], 1)
    return of(q, p), of(*turned)


def densities(points):
    return 1 + points[:, 0] / 4, 1 + points[:, 3] / 5


def forms(points):
    """rho1 dx1 dy1 + rho2 dx2 dy2 at each point."""
    out = np.zeros((len(points), 4, 4))
    for plane, density in enumerate(densities(points)):
        out[:, plane, 2 + plane], out[:, 2 + plane, plane] = density, -density
    return out


def test_two_planes_have_charts_of_their_own(tmp_path):
    path = tmp_path / "densities.npz"
    x, y = np.linspace(-1, 1, 41), np.linspace(-1.2, 1.2, 41)
    columns, rows = np.meshgrid(x, y)
    both = dict(x1=x, y1=y, density1=1 + columns / 4, x2=x, y2=y, density2=1 + rows / 5)
    np.savez(path, **both)
    before, after = two_planes()
    small = dict(kicks=(2, 1, 3), twists=(2, 1, 4), starts=1, iterations=40)
    model = gyroceptron.train(before, after, [[1, 0], [0, 1]], section=path, **small)
    assert not any("do not keep" in note for note in model.notes)
    polynomial = gyroceptron.SymplecticPolynomial(before, after, 7, section=path)
    model.save(tmp_path / "model.json")
    for map, limit in [(model, 3e-3), (gyroceptron.load(tmp_path / "model.json"), 3e-3), (polynomial, 1e-3)]:
        found = map.predict(before, 1)[-1]
        assert np.abs(found - after).max() < limit
        jacobian = map.jacobian(before)
        kept = jacobian.transpose(0, 2, 1) @ forms(found) @ jacobian
        assert np.abs(kept - forms(before)).max() < 1e-11
    # Without the charts, or with one of the two, the pairs keep no area.
    np.savez(path, **{name: both[name] for name in ("x1", "y1", "density1")}, planes=2)
    with pytest.warns(UserWarning, match="do not keep"):
        gyroceptron.train(before, after, [[1, 0], [0, 1]], section=path, **(small | dict(iterations=1)))


def test_charts_of_several_planes_are_checked(tmp_path):
    path = tmp_path / "densities.npz"
    x, y = np.linspace(-1, 1, 41), np.linspace(-1.2, 1.2, 41)
    second = dict(x2=x, y2=y, density2=np.ones((41, 41)))
    before, after = two_planes()
    refused = [
        (dict(x2=x, y2=y, density2=np.ones((40, 41))), "density2"),
        (dict(x2=x, density2=np.ones((41, 41))), "y2"),
        (dict(density2=-second["density2"], x2=x, y2=y), "positive"),
        (second | dict(planes=1), "npz: planes: expected a whole number from 2"),
        (second | dict(planes=2.5), "npz: planes: expected a whole number from 2"),
        (second | dict(planes=3.0), "section: planes: expected 2, found 3"),
        (second | dict(scale=2.0), "section: scale: expected"),
        (second | dict(x1=x, y1=y), "npz: arrays: expected .* found x1"),
        (second | dict(density17=x), "npz: arrays: expected .* found density17"),
        (dict(x=x, y=y, density=np.ones((41, 41)), planes=1.0), "none beside density"),
        (second | dict(x=x, y=y, density=np.ones((41, 41))), "npz: arrays: expected"),
    ]
    for arrays, word in refused:
        np.savez(path, **arrays)
        with pytest.raises(gyroceptron.Error, match=word):
            gyroceptron.train(before, after, [[1, 0], [0, 1]], section=path)
