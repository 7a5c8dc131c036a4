#!/usr/bin/env python3
"""Currents of Wendelstein 7-X for which its field lines do what is wanted, found by SciPy: with a map, and by tracing.

    python3 benches/peers/optimise.py [--model MODEL] [--threads N]

Makes a virtual environment of its own in target/peers-simsopt (simsopt, NumPy and SciPy from PyPI, and this package as
it stands) and takes the coils that simsopt ships. The control is the current of the planar coils, as a share of that
of the others. `gyroceptron run benches/w7-x-controls.toml` traces lines at thirteen of its values and trains one map for
all of them; with `--model` that is done already. Two things are wanted: other rotational transforms on the axis, and
the islands of 5/6 at other distances from it. Each is a root of a function of the control:

- by the map, Newton's method of `scipy.optimize.root_scalar`, with the exact derivative by the control from
  `model.orbit_response`;
- in the field of the coils, the secant method: orbits by Newton's method on `FieldLines.trace` and `.jacobian`, in
  the steps that an error of 1e-8 m takes.

What was found is judged in the field: the transform and the distance there, against what was wanted. Without a model it
takes some ten minutes.
"""

import argparse
import os
import shutil

import shared
from shared import seconds, table

FOLDER = shared.ROOT / "target" / "peers-simsopt"
PACKAGES = ["simsopt==1.11.1", "numpy", "scipy"]
FIELD_PERIODS, AT, REACH = 5, 0.5, 0.3
CURRENTS, PLANAR = [15000.0] * 5 + [0.0, 0.0], [0.0] * 5 + [15000.0] * 2
# The islands of transform 5/6: lines turn once in six periods. They are there from a share of 0.045 on.
PERIOD, WITH_ISLANDS = 6, 0.05

shared.enter(FOLDER, PACKAGES)

import importlib.resources  # noqa: E402

import numpy as np  # noqa: E402
from scipy.optimize import root_scalar  # noqa: E402

import gyroceptron  # noqa: E402


def transform(trace):
    """Of field lines near the axis, from Tr M of a period; and its slope."""
    turns = np.arccos(trace / 2) / (2 * np.pi)
    return FIELD_PERIODS * turns, -FIELD_PERIODS / (4 * np.pi * np.sin(2 * np.pi * turns))


class ByMap:
    """Questions to the map: a value, and its derivative by the control."""

    def __init__(self, model, axis, chain):
        self.model, self.guess = model, {1: axis, PERIOD: chain}

    def orbit(self, planar, period):
        found = self.model.orbit_response(self.guess[period], period, planar=planar)
        self.guess[period] = found["points"][0]
        return found

    def transform(self, planar):
        axis = self.orbit(planar, 1)
        value, slope = transform(axis["trace"])
        return value, slope * axis["trace_by"][0]

    def distance(self, planar):
        axis, chain = self.orbit(planar, 1), self.orbit(planar, PERIOD)
        return chain["points"][0][0] - axis["points"][0][0], chain["moved"][0, 0] - axis["moved"][0, 0]


class ByTracing:
    """The same in the field of the coils, without derivatives."""

    def __init__(self, coils, axis, chain):
        self.coils, self.guess, self.queries, self.making = coils, {1: axis, PERIOD: chain}, 0, 0.0

    def lines(self, planar):
        """The field at this current: coils, steps, axis."""
        self.queries += 1
        currents = np.add(CURRENTS, np.multiply(planar, PLANAR))
        options = dict(section=AT, reach=REACH, error=1e-8, axis=tuple(self.guess[1]))
        found, spent = seconds(lambda: gyroceptron.FieldLines(self.coils, currents, FIELD_PERIODS, **options))
        self.making += spent
        self.guess[1] = np.array(found.axis)
        return found

    def orbit(self, lines, period):
        """The first point of the periodic orbit near the last one."""
        z = self.guess[period]
        for _ in range(20):
            states = lines.trace(z, period, near_coils=False)
            whole = np.eye(2)
            for jacobian in lines.jacobian(states[:-1]):
                whole = jacobian @ whole
            step = np.linalg.solve(whole - np.eye(2), states[-1] - z)
            z = z - step
            if np.abs(step).max() <= 1e-10:
                self.guess[period] = z
                return z
        raise SystemExit(f"Newton's method finds no orbit of {period} periods in the field, last {step} m away")

    def transform(self, planar):
        lines = self.lines(planar)
        return transform(np.trace(lines.jacobian(lines.axis)))[0]

    def distance(self, planar):
        lines = self.lines(planar)
        return self.orbit(lines, PERIOD)[0] - lines.axis[0]


def chain_of(model, axis):
    """The point of the islands' elliptic orbit that is nearest to the midplane, outwards of the axis."""
    at = model.at(planar=WITH_ISLANDS)
    ((middle, *_),) = [orbit["points"] for orbit in at.periodic_orbits([axis])]
    guesses = middle + np.stack([np.linspace(0.1, 0.95, 120) * REACH, np.zeros(120)], axis=1)
    found = at.periodic_orbits(guesses, PERIOD)
    points = [z for orbit in found if 0 < orbit["residue"] < 1 for z in orbit["points"] if z[0] > middle[0] + 0.01]
    if not points:
        raise SystemExit(f"no islands of {PERIOD} periods between the axis and {REACH} m")
    return min(points, key=lambda z: abs(z[1] - middle[1]))


def wanted(name, aim, start, by_map, by_tracing):
    """The roots for one aim, from a first value of the control, and what the field says of them."""
    ask, trace = by_map(), by_tracing()

    def by_newton():
        def off(planar):
            value, slope = getattr(ask, name)(planar)
            return value - aim, slope

        return root_scalar(off, x0=start, fprime=True, method="newton", xtol=1e-10)

    def by_secants():
        def off(planar):
            return getattr(trace, name)(planar) - aim

        return root_scalar(off, x0=start, x1=start - 5e-4, method="secant", xtol=1e-7)

    learnt, of_map = seconds(by_newton)
    traced, of_field = seconds(by_secants)
    missed = [getattr(by_tracing(), name)(x) - aim for x in (learnt.root, traced.root)]
    return learnt, traced, missed, of_map, (of_field, trace.queries, trace.making)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="a model of `gyroceptron run benches/w7-x-controls.toml`")
    parser.add_argument("--threads", type=int, default=1, help="of tracing and training")
    options = parser.parse_args()
    given = options.model and os.path.abspath(options.model)
    os.chdir(FOLDER)
    coils = importlib.resources.files("simsopt.configs") / "W7-X.dat"
    if given is None:
        shutil.copy(coils, "W7-X.dat")
        shutil.copy(shared.ROOT / "benches" / "w7-x-controls.toml", "controls.toml")
        _, spent = seconds(
            lambda: gyroceptron.run("controls.toml", "controls", overwrite=True, threads=options.threads)
        )
        print(f"{spent:.0f} s for lines, training and report\n")
        given = "controls/model.json"
    model = gyroceptron.load(given)
    axis = gyroceptron.FieldLines(coils, CURRENTS, FIELD_PERIODS, section=AT, reach=REACH, error=1e-8).axis
    chain = chain_of(model, axis)

    def by_map():
        return ByMap(model, np.array(axis), chain)

    def by_tracing():
        return ByTracing(coils, np.array(axis), chain)

    starts = {"transform": 0.0, "distance": WITH_ISLANDS}
    first = {name: getattr(by_tracing(), name)(start) for name, start in starts.items()}
    print(f"transform on the axis without currents in the planar coils {first['transform']:.6f}, ", end="")
    print(f"islands of 5/6 for a share of {WITH_ISLANDS} at {first['distance']:.6f} m from it\n")
    aims = [("transform", -0.01), ("transform", 0.01), ("distance", -0.02), ("distance", -0.05)]
    words = {"transform": "transform on the axis {:.6f}", "distance": "islands at {:.6f} m"}
    head = ["wanted", "share of the planar coils: by the map, by tracing", "missed in the field by", "values and derivatives asked of the map, values of the field"]
    rows = []
    for name, change in aims:
        aim = first[name] + change
        learnt, traced, missed, of_map, of_field = wanted(name, aim, starts[name], by_map, by_tracing)
        rows.append(
            [
                words[name].format(aim),
                f"{learnt.root:.7f}, {traced.root:.7f}",
                f"{missed[0]:.1e}, {missed[1]:.1e}",
                f"{learnt.function_calls}, {of_field[1]}",
                f"{1e3 * of_map:.2f} ms",
                f"{of_field[0]:.2f} s, {of_field[0] - of_field[2]:.2f} s",
                f"{of_field[0] / of_map:.0f}, {(of_field[0] - of_field[2]) / of_map:.0f}",
            ]
        )
    head += ["by the map", "by tracing, and without its set-up", "times as long"]
    table(head, rows)


if __name__ == "__main__":
    main()
