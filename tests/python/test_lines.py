"""Field lines of coils, and what is asked of maps of a plane."""

import copy
import pickle
import warnings

import numpy as np
import pytest

import gyroceptron


@pytest.fixture(scope="module")
def lines():
    return gyroceptron.FieldLines(reach=0.06, error=1e-6)


def test_lines_are_traced_and_learnt(lines, tmp_path):
    radius, height = lines.axis
    assert abs(radius - 3.95753) < 1e-4 and abs(height) < 1e-9
    assert 0 < lines.error < 1e-6 and -0.07 < lines.turns < -0.06
    start = lines.starts(12)
    assert start.shape == (12, 2) and abs(start[-1, 0] - radius - 0.06) < 1e-14
    states = lines.trace(start, 40)
    assert states.shape == (41, 12, 2) and (states[0] == start).all()
    h = 1e-6
    ends = [lines.trace(start[3] + [step, 0], 1)[-1] for step in (h, -h)]
    jacobian = lines.jacobian(start[3])
    assert np.abs((ends[0] - ends[1]) / (2 * h) - jacobian[:, 0]).max() < 1e-6
    section = tmp_path / "section.npz"
    lines.write_section(section, states)
    with pytest.raises(gyroceptron.Error, match="overwrite=True"):
        lines.write_section(section, states)
    model = gyroceptron.train(
        states[:-1].reshape(-1, 2),
        states[1:].reshape(-1, 2),
        [1],
        section=section,
        kicks=(4, 1, 6),
        twists=(1, 1, 4),
        perturbation=(4, 1, 6),
        starts=1,
        iterations=40,
    )
    found = model.predict(states[0], 40)
    assert np.abs(found - states).max() < 1e-4
    # The axis is a fixed point of the model: lines turn about it as fast as about that of the field.
    (orbit,) = model.periodic_orbits([[radius, 0.0]])
    assert np.abs(orbit["points"] - lines.axis).max() < 1e-5
    assert abs(orbit["trace"] - np.trace(lines.jacobian([radius, height]))) < 1e-3
    assert orbit["residue"] == pytest.approx((2 - orbit["trace"]) / 4)
    assert np.abs(orbit["multiplier"] - model.jacobian(orbit["points"][0])).max() < 1e-12
    assert orbit["missed"] < 1e-12
    # On the midplane, the line of symmetry; a map that is reversible only nearly has no orbit that begins just there.
    for one in model.symmetric_orbits("positions", radius - 0.03, radius + 0.03, samples=31):
        assert np.abs(one["points"] - orbit["points"]).max() < 1e-4
    with pytest.raises(gyroceptron.Error, match="ascending"):
        model.symmetric_orbits("positions", radius, radius - 0.01)
    with pytest.raises(gyroceptron.Error, match="positions or momenta"):
        model.symmetric_orbits("midplane", radius - 0.01, radius)
    with pytest.raises(gyroceptron.Error, match="one point"):
        model.island(states[0], around=lines.axis)
    assert abs(model.lyapunov_exponent(states[0, 5], 500)) < 0.05
    with pytest.raises(gyroceptron.Error, match="one point"):
        model.lyapunov_exponent(states[0], 500)


def test_rotation_and_curves_are_found():
    turns = (5**0.5 - 1) / 2
    u = 2 * np.pi * turns * np.arange(400)
    orbit = np.stack([1 + np.cos(u) + 0.1 * np.cos(2 * u), 0.5 * np.sin(u)], 1)
    found, error = gyroceptron.rotation_number(orbit, (1.0, 0.0), 0.6)
    assert abs(found - turns) < 1e-7 and error < 1e-5
    # Of several orbits each has that of itself alone, and one that is lost has none.
    lost = orbit.copy()
    lost[300:] = np.nan
    of_all, errors = gyroceptron.rotation_number(np.stack([orbit, orbit[:, ::-1], lost], 1), (1.0, 0.0), 0.6)
    alone = gyroceptron.rotation_number(orbit[:, ::-1], (1.0, 0.0), 0.6)
    assert of_all.shape == (3,) and (of_all[0], errors[0]) == (found, error)
    assert (of_all[1], errors[1]) == alone and np.isnan(of_all[2]) and np.isnan(errors[2])
    with pytest.raises(gyroceptron.Error, match="orbit: .*shape"):
        gyroceptron.rotation_number(np.zeros((5, 3)), (0.0, 0.0))
    # At the centre there is no angle.
    assert np.isnan(gyroceptron.rotation_number(np.zeros((500, 2)), (0.0, 0.0))).all()
    circle = gyroceptron.InvariantCircle(orbit, found)
    assert abs(circle.turns - turns) < 1e-13 and circle.error < 1e-12
    assert abs(circle.area - np.pi / 2) < 1e-12
    assert circle.points(5).shape == (5, 2)
    assert circle.distances(orbit[:8]).max() < 1e-12
    assert circle.distances([[2.1 + 1e-3, 0.0]])[0] == pytest.approx(1e-3)
    assert "InvariantCircle" in repr(circle)


def test_the_flux_within_a_curve(tmp_path):
    u = 2 * np.pi * (5**0.5 - 1) / 2 * np.arange(400)
    circle = gyroceptron.InvariantCircle(np.stack([2 + 0.5 * np.cos(u), 0.5 * np.sin(u)], 1), 0.618)
    x, y = np.linspace(1, 3, 17), np.linspace(-1, 1, 17)
    density = 1 + 0.3 * x[None, :] + 0.2 * y[:, None] ** 2
    np.savez(tmp_path / "rho.npz", x=x, y=y, density=density, scale=np.array([2.5]))
    expected = np.pi / 4 * (1.6 + 0.2 / 16)
    assert circle.flux(tmp_path / "rho.npz") == pytest.approx(expected, rel=1e-12)
    np.savez(tmp_path / "both.npz", x=x, y=y, density=[density, 2 * density], **{"lambda": [0.0, 1.0]})
    assert circle.flux(tmp_path / "both.npz", [0.5]) == pytest.approx(1.5 * expected, rel=1e-12)
    for section, controls in [("both.npz", None), ("both.npz", [0.5, 1.0]), ("rho.npz", [0.5])]:
        with pytest.raises(gyroceptron.Error, match="controls"):
            circle.flux(tmp_path / section, controls)
    none = {"density": np.zeros((0, 17, 17)), "lambda": np.zeros((0, 2**50))}
    np.savez(tmp_path / "none.npz", x=x, y=y, **none)
    with pytest.raises(gyroceptron.Error, match="lambda: controls"):
        circle.flux(tmp_path / "none.npz", [0.5])
    lines = gyroceptron.FieldLines(reach=0.05, error=1e-7)
    assert lines.density(lines.starts(3)).shape == (3,)
    assert lines.density(lines.axis) > 0.1


def test_manifolds_and_chaos_of_a_model():
    """A pendulum that is kicked: z -> (q + p', p + K sin q), learnt by one HenonNet of polynomials."""
    rng = np.random.default_rng(3)
    q, p = rng.uniform(-1.5, 1.5, (2, 600))
    kicked = p + 0.6 * np.sin(q)
    before, after = np.stack([q, p], 1), np.stack([q + kicked, kicked], 1)
    model = gyroceptron.train(
        before, after, [1], architecture="henon-net", layers=(3, 1, 9), iterations=150, starts=1
    )
    (orbit,) = model.periodic_orbits([[0.01, 0.0]])
    assert abs(orbit["residue"] + 0.15) < 0.02
    short = dict(start=1e-5, spacing=0.02, length=1.2)
    out = model.manifold([0.01, 0.0], **short)
    assert out.shape[1] == 2 and np.abs(np.diff(out, axis=0)).max() <= 0.02
    # Backwards the unstable one comes to the fixed point, forwards the stable one does.
    back = model.manifold([0.01, 0.0], stable=True, **short)
    z, w = out[-1], back[-1]
    for _ in range(14):
        z, w = model.inverse(z), model.predict(w)[-1]
    fixed = orbit["points"][0]
    assert np.abs(z - fixed).max() < 1e-2 and np.abs(w - fixed).max() < 1e-2
    other = model.manifold([0.01, 0.0], forward=False, **short)
    assert np.dot(out[-1] - fixed, other[-1] - fixed) < 0
    assert 0 <= model.alignment_index(fixed, 40) < 1e-12
    # An orbit that polynomials send to infinity is lost alone, and is reported.
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        far = model.predict([[0.1, 0.1], [1e200, 0.0]], 3)
    assert np.isfinite(far[:, 0]).all() and np.isnan(far[-1, 1]).all()
    assert any("no finite image" in str(one.message) for one in found), found
    with pytest.raises(gyroceptron.Error, match="residue"):
        model.manifold([np.pi, 0.0], **short)
    polynomial = gyroceptron.SymplecticPolynomial(before, after, 11)
    for stable in (False, True):
        end = polynomial.manifold([0.01, 0.0], stable=stable, **short)[-1]
        for _ in range(14):
            end = polynomial.predict(end)[-1] if stable else polynomial.inverse(end)
        assert np.abs(end).max() < 1e-3


def kicked(points, strength=1.06):
    """Half a drift, a kick by -K sin q, half a drift: reversible, with islands of six where p = 0.69."""
    q, p = points[..., 0] + points[..., 1] / 2, points[..., 1]
    after = p - strength * np.sin(q)
    return np.stack([q + after / 2, after], -1)


def test_islands_of_a_model_are_as_wide_as_those_of_the_map():
    points = np.random.default_rng(5).uniform(-1.1, 1.1, (1500, 2))
    model = gyroceptron.train(
        points,
        kicked(points),
        [1],
        architecture="normal-form",
        reversor="positions",
        kicks=(6, 1, 8),
        twists=(1, 1, 5),
        perturbation=(8, 1, 8),
        starts=1,
        iterations=100,
    )
    (orbit,) = model.symmetric_orbits("positions", 0.5, 1.0, 6)
    assert 0 < orbit["residue"] < 1 and abs(orbit["points"][0][0]) < 1e-9
    island = model.island(orbit["points"][0], 6, around=[0.0, 0.0])
    # On the ray of p, orbits of the map itself that turn by a sixth in the mean.
    ray = np.linspace(0.6, 0.8, 401)
    z, turned = np.stack([np.zeros(401), ray], 1), np.zeros(401)
    for _ in range(3000):
        angle = np.arctan2(*z.T)
        z = kicked(z)
        turned += np.mod(np.arctan2(*z.T) - angle, 2 * np.pi)
    inside = ray[np.abs(turned / 3000 / (2 * np.pi) - 1 / 6) < 2e-5]
    assert abs(island["low"] - inside[0]) < 2e-3 and abs(island["high"] - inside[-1]) < 2e-3
    assert island["width"] == pytest.approx(island["high"] - island["low"], rel=1e-12)
    assert island["width"] == pytest.approx(inside[-1] - inside[0], rel=0.03)
    assert abs(island["angle"]) == pytest.approx(np.pi / 2, abs=1e-9)
    assert model.island([0.0, 0.0], around=[0.0, -0.1]) is None
    # A polynomial of no training has them too.
    polynomial = gyroceptron.SymplecticPolynomial(points, kicked(points), 14, "positions")
    (orbit,) = polynomial.symmetric_orbits("positions", 0.5, 1.0, 6)
    found = polynomial.island(orbit["points"][0], 6, around=[0.0, 0.0])
    assert found["width"] == pytest.approx(inside[-1] - inside[0], rel=0.03)


def torsatron():
    """The built-in coils by points: two windings and two rings."""
    t = 2 * np.pi * np.arange(60) / 60
    rows = []
    for shift in (0, np.pi):
        radius = 3.9 + 0.975 * np.cos(5 * t + shift)
        height = -0.975 * np.sin(5 * t + shift)
        rows.append(np.stack([radius * np.cos(t), radius * np.sin(t), height], 1))
    for height in (1.55, -1.55):
        rows.append(np.stack([5.55 * np.cos(t), 5.55 * np.sin(t), np.full(60, height)], 1))
    return np.stack(rows)


def test_coils_are_read_by_points(lines, tmp_path):
    path = tmp_path / "coils.npz"
    np.savez(path, points=torsatron())
    currents = [5e6, 5e6, -3e6, -3e6]
    with pytest.raises(gyroceptron.Error, match="coil 1, an image of which is coil 2"):
        gyroceptron.FieldLines(path, currents, 10, stellarator_symmetric=False)
    # The image of a winding is the other one.
    np.savez(path, points=torsatron()[[0, 2, 3]])
    made = gyroceptron.FieldLines(
        path, currents[1:], 10, stellarator_symmetric=False, reach=0.02, error=1e-3
    )
    assert np.abs(np.subtract(made.axis, lines.axis)).max() < 1e-4
    assert abs(made.turns - lines.turns) < 1e-3
    with pytest.raises(gyroceptron.Error, match="currents: expected 3, found 1"):
        gyroceptron.FieldLines(path, [1.0], 10)
    np.savez(path, points=torsatron()[0])
    with pytest.raises(gyroceptron.Error, match="points of each of C coils"):
        gyroceptron.FieldLines(path, currents, 10)
    np.savez(path, other=torsatron())
    with pytest.raises(gyroceptron.Error, match="points"):
        gyroceptron.FieldLines(path, currents, 10)


def test_the_field_is_that_of_biot_and_savart(tmp_path):
    path = tmp_path / "coils.npz"
    np.savez(path, points=torsatron()[[0, 2, 3]])
    currents = np.array([5e6, 5e6, -3e6, -3e6])
    made = gyroceptron.FieldLines(
        path, currents[1:], 10, stellarator_symmetric=False, reach=0.02, error=1e-3
    )
    # The law itself, of the formulas of the coils.
    t = 2 * np.pi * np.arange(3000) / 3000
    coils = []
    for shift in (0, np.pi):
        radius, slope = 3.9 + 0.975 * np.cos(5 * t + shift), -5 * 0.975 * np.sin(5 * t + shift)
        c, s = np.cos(t), np.sin(t)
        height, climb = -0.975 * np.sin(5 * t + shift), -5 * 0.975 * np.cos(5 * t + shift)
        at = np.stack([radius * c, radius * s, height], 1)
        coils.append((at, np.stack([slope * c - radius * s, slope * s + radius * c, climb], 1)))
    for height in (1.55, -1.55):
        at = np.stack([5.55 * np.cos(t), 5.55 * np.sin(t), np.full(3000, height)], 1)
        coils.append((at, np.stack([-at[:, 1], at[:, 0], np.zeros(3000)], 1)))
    angles = np.array([0.1, 2.0, 4.4])
    radii, heights = np.array([3.9, 4.0, 3.8]), np.array([0.0, 0.1, -0.2])
    places = np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], 1)
    law = np.zeros((3, 3))
    for (at, tangent), current in zip(coils, currents, strict=True):
        away = places[:, None] - at
        cross = np.cross(tangent, away) / np.linalg.norm(away, axis=2)[..., None] ** 3
        law += 1e-7 * current * cross.mean(1) * 2 * np.pi
    field = made.field(places)
    # As exact as points along the coils are for the error that was asked for.
    assert np.abs(field - law).max() < 1e-3 * np.abs(law).max()
    assert made.field(places[0]).shape == (3,) and (made.field(places[0]) == field[0]).all()
    toroidal = field[:, 1] * np.cos(angles) - field[:, 0] * np.sin(angles)
    # The density is that in the half-plane of the section, at phi = 0.
    there = np.stack([radii, 0 * radii, heights], 1)
    assert np.allclose(made.density(there[:, [0, 2]]), np.abs(made.field(there)[:, 1]), rtol=1e-12)
    assert (np.abs(toroidal) > 1.0).all()
    gradient = made.field_gradient(places)
    assert gradient.shape == (3, 3, 3)
    h = 1e-5
    for j in range(3):
        step = h * np.eye(3)[j]
        slope = (made.field(places + step) - made.field(places - step)) / (2 * h)
        assert np.abs(slope - gradient[:, :, j]).max() < 1e-6 * np.abs(gradient).max()
    # div B = 0, of each element of a coil; curl B = 0, of whole coils.
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-12 * np.abs(gradient).max()
    curl = gradient - gradient.transpose(0, 2, 1)
    assert np.abs(curl).max() < 1e-2 * np.abs(gradient).max()
    with pytest.raises(gyroceptron.Error, match="places: columns: expected 3, found 2"):
        made.field([[1.0, 2.0]])


def test_lines_are_followed_backwards_and_until_they_leave(lines):
    start = lines.starts(6)
    end = lines.trace(start, 1)[-1]
    assert np.abs(lines.inverse(end) - start).max() < 10 * lines.error
    # Not by following them forwards.
    assert np.abs(lines.trace(end, 1)[-1] - start).max() > 1e-3
    low, high = np.array(lines.axis) - [0.05, 0.2], np.array(lines.axis) + [0.05, 0.2]
    found = lines.survival(start, 40, list(low), list(high))
    states = lines.trace(start, 40)
    outside = ((states < low) | (states > high)).any(axis=2)
    first = [np.argmax(one) if one.any() else 41 for one in outside.T]
    assert found.dtype == np.int64 and found.tolist() == first
    assert found[0] == 41 and 1 < found[3] < 41
    with pytest.raises(gyroceptron.Error, match="low"):
        lines.survival(start, 4, [0.0], [1.0])


def test_manifolds_of_a_field_are_followed_both_ways(lines):
    (orbit,) = lines.periodic_orbits([[3.575, 0.0]], 11)
    fixed = orbit["points"][0]
    assert orbit["residue"] == pytest.approx(-0.53, abs=0.01)
    short = dict(start=1e-3, spacing=0.02, length=0.05)
    out = lines.manifold(fixed, 11, **short)
    back = lines.manifold(fixed, 11, stable=True, **short)
    # One comes from the orbit, the other goes to it.
    for end, to_orbit in ((out[-1], lines.inverse), (back[-1], lambda z: lines.trace(z, 1)[-1])):
        assert np.linalg.norm(end - fixed) > 0.03
        for _ in range(4 * 11):
            end = to_orbit(end)
        assert np.linalg.norm(end - fixed) < 1e-3
    # Half a turn about an axis in the section takes lines to lines that run backwards.
    mirrored = np.array([1.0, -1.0]) * back
    if (mirrored[-1] - fixed) @ (out[-1] - fixed) < 0:
        back = lines.manifold(fixed, 11, stable=True, forward=False, **short)
        mirrored = np.array([1.0, -1.0]) * back
    assert np.abs(mirrored[-1] - out[-1]).max() < 1e-4
    with pytest.raises(gyroceptron.Error, match="residue"):
        lines.manifold(lines.axis, 1)


def test_bad_lines_are_refused(lines, tmp_path):
    def refused(match, *given, **named):
        with pytest.raises(gyroceptron.Error, match=match):
            gyroceptron.FieldLines(*given, **named)

    refused("reach", reach=0.9)
    refused("reach", reach=-1.0)
    refused("currents", currents=[1.0])
    refused("currents", tmp_path / "coils.dat")
    refused("coils.dat", tmp_path / "coils.dat", [1.0], 5)
    short = tmp_path / "short.dat"
    short.write_text("0,0,0,0,0,0\n1,1,1\n")
    refused("short.dat:2", short, [1.0], 5)
    with pytest.raises(gyroceptron.Error, match="columns"):
        lines.trace([[1.0, 2.0, 3.0]], 2)
    # On a coil, and one that stays.
    places = [[3.9 + 0.975, 0.0], [3.96, 0.0]]
    with pytest.warns(UserWarning, match=r"1 of 2 lines leave the machine.*row 0 .*in map 1"):
        states = lines.trace(places, 2)
    assert np.isnan(states[1:, 0]).all() and np.isfinite(states[:, 1]).all()
    # One comes nearer to a coil than points along it resolve, though it stays in the machine.
    coarse = gyroceptron.FieldLines(reach=0.06, error=1e-6)
    beside = [[3.96, 0.0], [4.2, 0.0]]
    words = r"1 of 2 lines come nearer to a coil.*row 1 .*after map 0, at \(R, Z\) = \(4.2000"
    with pytest.warns(UserWarning, match=words):
        states = coarse.trace(beside, 1)
    assert np.isfinite(states).all() and coarse.distance_to_coils(beside, 1)[1] > 0.5
    jacobians = lines.jacobian(places)
    assert np.isnan(jacobians[0]).all() and abs(np.linalg.det(jacobians[1]) - 1) < 0.1
    distances = lines.distance_to_coils(places, 3)
    assert distances.shape == (2,) and np.isnan(distances[0]) and 0.3 < distances[1] < 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lines.trace(places[1], 2)
    with pytest.raises(gyroceptron.Error, match="states"):
        gyroceptron.InvariantCircle(np.zeros((10, 2)), 0.1)
    # What is no mirror plane has no line of symmetry, nor has R = 0.
    for section, reversor in [(0.25, "positions"), (0.0, "momenta")]:
        made = gyroceptron.FieldLines(section=section, reach=0.02, error=1e-3)
        with pytest.raises(gyroceptron.Error, match="mirror plane"):
            made.symmetric_orbits(reversor, 3.9, 4.0)
    # An orbit of another period than the one that was asked for.
    with pytest.raises(gyroceptron.Error, match=r"orbit of period 1, at \(3\.957"):
        lines.island(lines.axis, 3, around=[lines.axis[0], 0.01])


def test_a_map_of_a_turn_counts_whole_turns(lines):
    turn = gyroceptron.FieldLines(periods=10, reach=0.02, error=1e-4)
    assert turn.turns == pytest.approx(10 * lines.turns, abs=1e-4) and abs(turn.turns) > 0.5
    orbit = turn.trace(turn.starts(1)[0], 100)
    found, _ = gyroceptron.rotation_number(orbit, tuple(turn.axis), turn.turns)
    assert found == pytest.approx(turn.turns, abs=5e-3)


def test_pairs_of_a_mirror_plane_are_reversible(lines, tmp_path):
    """Errors of tracing are a smooth function of the points, and no sign of another map."""
    section = tmp_path / "section.npz"
    for shift, reversor, words in [
        (0.0, "positions", None),
        (0.0, None, "a map that is reversible by"),
        # About a reflection that is not theirs.
        (0.01, "positions", "no map that is reversible"),
    ]:
        states = lines.trace(lines.starts(12), 60) + [0, shift]
        lines.write_section(section, states, overwrite=True)
        before, after = states[:-1].reshape(-1, 2), states[1:].reshape(-1, 2)
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            gyroceptron.SymplecticPolynomial(before, after, 12, reversor, section)
        said = [str(one.message) for one in found if "reversible" in str(one.message)]
        assert len(said) == (words is not None) and all(words in one for one in said), said


def test_lines_that_leave_the_section_are_nan(lines, tmp_path):
    states = lines.trace(lines.starts(12), 40)
    section = tmp_path / "section.npz"
    lines.write_section(section, states)
    before, after = states[:-1].reshape(-1, 2), states[1:].reshape(-1, 2)
    polynomial = gyroceptron.SymplecticPolynomial(before, after, 9, section=section)
    inside, corner = before[0], before.max(axis=0) + [1e-3, 1e-3]
    model = gyroceptron.train(
        before, after, [1], section=section, kicks=(2, 1, 4), twists=(1, 1, 3), starts=1, iterations=10
    )
    for one in (polynomial, model):
        with pytest.warns(UserWarning, match="outside the box of the section"):
            found = one.predict([inside, corner], 300)
        assert np.isfinite(found[:, 0]).all()
        lost = np.isnan(found[:, 1]).any(axis=1)
        # Once lost it stays lost.
        assert lost.any() and lost[lost.argmax() :].all()
        with pytest.raises(gyroceptron.Error, match="outside the box"):
            one.predict([inside, corner], 300, outside="stop")
        assert np.isnan(one.predict(corner, 300, outside="ignore")[-1]).all()


def test_a_symplectic_polynomial_is_fitted_in_the_chart_of_a_section(lines, tmp_path):
    start = lines.starts(12)
    states = lines.trace(start, 40)
    section = tmp_path / "section.npz"
    lines.write_section(section, states)
    before, after = states[:-1].reshape(-1, 2), states[1:].reshape(-1, 2)
    # The polynomial that ignores the area form cannot follow, the other does; its reflection is that of Z.
    plain = gyroceptron.SymplecticPolynomial(before, after, 9)
    own = gyroceptron.SymplecticPolynomial(before, after, 9, section=section)
    even = gyroceptron.SymplecticPolynomial(before, after, 9, "positions", section)
    assert own.error(before, after) < 1e-6 and even.error(before, after) < 2e-6
    assert plain.error(before, after) > 30 * own.error(before, after)
    assert len(even.parameters) == 29 and len(own.parameters) == 54
    assert np.abs(own.predict(start, 40) - states).max() < 1e-4
    # The Jacobian in R and Z, by differences, and its determinant: the ratio of both densities.
    h = 1e-6
    ends = [own.predict(start[3] + [step, 0])[-1] for step in (h, -h)]
    assert np.abs((ends[0] - ends[1]) / (2 * h) - own.jacobian(start[3])[:, 0]).max() < 1e-7
    assert np.abs(own.jacobian(start[3]) - lines.jacobian(start[3])).max() < 1e-3
    # The axis is a fixed point of the field, and of the polynomials, on the midplane of the even one.
    ((axis,), (of_own,)) = (one.periodic_orbits([lines.axis]) for one in (lines, own))
    (of_even,) = even.symmetric_orbits("positions", lines.axis[0] - 0.03, lines.axis[0] + 0.03, samples=31)
    assert np.abs(axis["points"] - lines.axis).max() < 1e-6
    for one in (of_own, of_even):
        assert np.abs(one["points"] - axis["points"]).max() < 1e-5
        assert abs(one["trace"] - axis["trace"]) < 1e-3
    (found,) = lines.symmetric_orbits("positions", lines.axis[0] - 0.02, lines.axis[0] + 0.02, samples=5)
    assert np.abs(found["points"] - axis["points"]).max() < 1e-6
    assert abs(lines.lyapunov_exponent(start[3], 60) - own.lyapunov_exponent(start[3], 60)) < 1e-3
    assert lines.alignment_index(start[3], 60) == pytest.approx(own.alignment_index(start[3], 60), rel=0.05)
    assert lines.island(lines.axis, around=[lines.axis[0], 0.01]) is None
    path = tmp_path / "map.json"
    even.save(path)
    copies = [copy.copy(own), copy.deepcopy([own])[0]]
    copies += [pickle.loads(pickle.dumps(own, protocol)) for protocol in range(6)]
    for one in copies:
        assert np.array_equal(one.predict(before), own.predict(before)) and one.degree == own.degree
    with pytest.raises(gyroceptron.Error, match="pickled polynomial"):
        pickle.loads(pickle.dumps(own).replace(b'"digest"', b'"digesT"'))
    back = gyroceptron.SymplecticPolynomial.load(path)
    assert (back.predict(start, 40) == even.predict(start, 40)).all()
    assert back.region == even.region and (back.parameters == even.parameters).all()
    with pytest.raises(gyroceptron.Error, match="map.json"):
        own.save(path)
    own.save(path, overwrite=True)
    assert len(gyroceptron.SymplecticPolynomial.load(path).parameters) == 54
    with pytest.raises(gyroceptron.Error, match="gyroceptron-model"):
        gyroceptron.load(path)
    path.write_text(path.read_text().replace('"degree": 9', '"degree": 8'))
    with pytest.raises(gyroceptron.Error, match="coefficients"):
        gyroceptron.SymplecticPolynomial.load(path)
    with pytest.raises(gyroceptron.Error, match="points of the section"):
        own.predict([1.0, 0.0])
    with pytest.raises(gyroceptron.Error, match="missing.npz"):
        gyroceptron.SymplecticPolynomial(before, after, 9, section=tmp_path / "missing.npz")


def test_orbits_that_a_polynomial_loses_are_reported():
    """Between states that are kept, too; and starts outside of a box have not survived."""
    angle = 2 * np.pi * 0.2114
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    before = np.random.default_rng(0).uniform(-0.7, 0.7, (1500, 2))
    after = np.stack([before[:, 0], before[:, 1] + before[:, 0] ** 2], axis=1) @ turn
    henon = gyroceptron.SymplecticPolynomial(before, after, 12)
    start = [[0.1, 0.1], [0.69, 0.69]]
    with pytest.warns(UserWarning, match="rows 1, the first from row 1 after 100 steps: it and all later ones are NaN"):
        states = henon.predict(start, 400, every=100)
    assert np.isfinite(states[:, 0]).all() and np.isnan(states[1:, 1]).all()
    with pytest.raises(gyroceptron.Error, match="no finite image"):
        henon.predict(start, 400, every=100, outside="stop")
    assert henon.survival([[0.75, -0.3], [0.1, 0.1]], 2, [-0.7, -0.7], [0.7, 0.7]).tolist() == [0, 3]
    assert henon.dynamic_aperture([0, 0], [[1, 0]], [0.1, 0.2, 0.72], 1, [-0.7, -1], [0.7, 1]).tolist() == [0.2]
    with pytest.raises(gyroceptron.Error, match="states to keep"):
        henon.predict(np.full((1000, 2), 0.1), 2**62)
    # The axis, and the fixed point of the map at q = 2 tan(angle/2), which is beyond the pairs.
    guesses = [[0.01, 0.0], [1.5, -1.2]]
    found = henon.periodic_orbits(guesses)
    assert [orbit["inside"] for orbit in found] == [True, False]
    assert gyroceptron.FieldLines().periodic_orbits([[3.95, 0.0]])[0]["inside"] is None
