#!/usr/bin/env python3
"""Maps of the field lines of Wendelstein 7-X beside tracing by simsopt, and the table of their errors and times.

    python3 benches/peers/simsopt_lines.py [--lines N] [--periods N] [--intervals N ...] [--long N] [--short]
        [--tolerances T ...]

Makes a virtual environment of its own in target/peers-simsopt (simsopt and NumPy from PyPI, and this package as it
stands) and takes the coils of the standard configuration that simsopt ships. `gyroceptron.FieldLines` traces lines
through the section at half a field period, to 1e-10 m; `gyroceptron.train` learns the map of a period from seven
lines of eight, and the eighth judges it; so does a symplectic polynomial. Beside it
`simsopt.field.compute_fieldlines` traces the same lines: through `InterpolatedField` of degree 4 on grids of N, 2N
and N/2 intervals along R, φ and Z, as its examples do, and in the field of the coils, each to several tolerances of
its steps. Compared are a period and all periods of the held-out lines, how far lines are off their surfaces after
`--long` periods, the time of a period of a line on one thread, and after how many periods of lines data and training
are paid for.

Takes eleven minutes, most of them tracing.
"""

import argparse
import functools
import itertools
import os

import shared
from shared import seconds, table

FOLDER = shared.ROOT / "target" / "peers-simsopt"
PACKAGES = ["simsopt==1.11.1", "numpy"]
# The machine, and the section: half-way between two planes of symmetry, lines out to here.
FIELD_PERIODS, AT, REACH = 5, 0.5, 0.45
# Periods of each line that are learnt, as in the scene `coils`.
LEARNT = 80
NETWORKS = {
    "map of jolts": dict(kicks=(10, 1, 12), twists=(1, 1, 8), perturbation=(14, 1, 12)),
    "map of jolts, reversible": dict(kicks=(12, 1, 16), twists=(1, 1, 8), perturbation=(0, 1), reversor="positions"),
}

# Of the symplectic polynomial that is set beside them, which is fitted, not trained; and where few pairs are traced.
DEGREE, SHORT_DEGREE = 25, 9

shared.enter(FOLDER, PACKAGES)

import importlib.resources  # noqa: E402

import numpy as np  # noqa: E402
import simsopt.configs  # noqa: E402
import simsoptpp  # noqa: E402
from simsopt.field import BiotSavart, Current, InterpolatedField, coils_via_symmetries  # noqa: E402

import gyroceptron  # noqa: E402

PERIOD = 2 * np.pi / FIELD_PERIODS


class Machine:
    """The coils that carry a current, as both programs have them."""

    def __init__(self):
        curves, currents, *_ = simsopt.configs.get_data("w7x", points_per_period=4)
        currents = [current.get_value() for current in currents]
        # By simsopt lines go along the field: turned round, it points towards larger φ.
        carry = [(curve, Current(-current)) for curve, current in zip(curves, currents) if current != 0]
        self.field = BiotSavart(coils_via_symmetries(*zip(*carry), FIELD_PERIODS, True))
        coils = importlib.resources.files("simsopt.configs") / "W7-X.dat"
        self.lines = gyroceptron.FieldLines(coils, currents, FIELD_PERIODS, section=AT, reach=REACH)

    def interpolated(self, intervals, box):
        """The field on a grid of `intervals` along R; box is of R and |Z|."""
        (low, high), top = box
        field = InterpolatedField(
            self.field,
            4,
            (low, high, intervals),
            (0, PERIOD, 2 * intervals),
            (0, top, intervals // 2),
            True,
            nfp=FIELD_PERIODS,
            stellsym=True,
        )
        # It is made when it is asked for a value.
        field.set_points(np.array([[0.5 * (low + high), 0.0, 0.0]]))
        field.B()
        return field

    def trace(self, field, points, periods, tolerance, paths=None):
        """States (periods + 1, lines, 2) by simsopt, where lines cross the section and its images, and how many
        crossings it found; all its steps too if `paths` is a list."""
        turned, (r, z) = AT * PERIOD, self.lines.axis
        angles = [(turned + k * PERIOD) % (2 * np.pi) for k in range(FIELD_PERIODS)]
        self.field.set_points(np.array([[r * np.cos(turned), r * np.sin(turned), z]]))
        # Time is a length over the field. Lines take as much as the axis, to a few parts of a hundred.
        until = 1.05 * (periods + 1) * PERIOD * r / self.field.B_cyl()[0, 1]
        out, found = np.full((periods + 1, len(points), 2), np.nan), 0
        out[0] = points
        for line, (r, z) in enumerate(points):
            start = [r * np.cos(turned), r * np.sin(turned), z]
            path, hits = simsoptpp.fieldline_tracing(field, start, until, tolerance, phis=angles)
            hits = np.array([hit for hit in hits if hit[0] > 1e-6 * until and hit[1] >= 0])
            found += len(hits)
            hits = hits[:periods]
            out[1 : len(hits) + 1, line] = np.stack([np.hypot(hits[:, 2], hits[:, 3]), hits[:, 4]], axis=1)
            if paths is not None:
                paths.append(np.array(path))
        return out, found


def rms(states, truth):
    """Root mean square distance of points, in metres."""
    return np.sqrt(((states - truth) ** 2).sum(axis=-1).mean())


def train(machine, states, network, options):
    """A model of the pairs of these lines, or the polynomial."""
    machine.lines.write_section("density.npz", states, overwrite=True)
    before, after = states[:-1].reshape(-1, 2), states[1:].reshape(-1, 2)
    if "degree" in network:
        return gyroceptron.SymplecticPolynomial(before, after, section="density.npz", **network)
    short = dict(starts=1, iterations=20) if options.short else dict(starts=3, iterations=800)
    return gyroceptron.train(before, after, [1], section="density.npz", **short, **network)


class Surfaces:
    """The curves in the section on which traced lines are, by Fourier series."""

    def __init__(self, machine, starts, count):
        self.circles = []
        for orbit in np.moveaxis(machine.lines.trace(starts, count), 1, 0):
            turns, _ = gyroceptron.rotation_number(orbit, machine.lines.axis, machine.lines.turns)
            self.circles.append(gyroceptron.InvariantCircle(orbit, turns))

    def off(self, states):
        """How far the furthest state (T, lines, 2) is off the surface of its line."""
        return max(circle.distances(states[:, line]).max() for line, circle in enumerate(self.circles))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", type=int, default=64, help="lines, of which every eighth is held out")
    parser.add_argument("--periods", type=int, default=100, help="periods over which errors are compared")
    parser.add_argument("--intervals", type=int, nargs="+", default=[20, 30, 40], help="intervals along R of the grids")
    parser.add_argument(
        "--tolerances", type=float, nargs="+", default=[1e-6, 1e-7, 1e-8, 1e-9], help="of the steps of simsopt"
    )
    parser.add_argument("--long", type=int, default=10_000, help="periods after which lines are compared with surfaces")
    parser.add_argument("--surface", type=int, default=1000, help="traced points of which a surface is made")
    parser.add_argument("--short", action="store_true", help="few of all, to see that it runs")
    options = parser.parse_args()
    if options.short:
        options.lines, options.periods, options.intervals, options.long, options.surface = 8, 20, [8], 400, 300
        options.tolerances = [1e-6]
    os.chdir(FOLDER)
    machine, making = seconds(Machine)
    starts = machine.lines.starts(options.lines)
    learnt = min(LEARNT, options.periods)
    held = np.arange(options.lines) % 8 == 3
    states, tracing = seconds(lambda: machine.lines.trace(starts, learnt, near_coils=False))
    pairs = states[:, ~held]
    truth = machine.lines.trace(starts[held], options.periods)
    # Lines that are long off, half of them.
    far = np.flatnonzero(held)[:: 2 if held.sum() > 2 else 1]
    surfaces = Surfaces(machine, starts[far], options.surface)
    print(f"{making:.1f} s for the axis and steps, {tracing:.1f} s for {learnt} periods of {options.lines} lines\n", flush=True)

    paths = []
    machine.trace(machine.field, starts[-1:], 12, 1e-7, paths)
    path = paths[0]
    radius = np.hypot(path[:, 1], path[:, 2])
    box = (radius.min() - 0.05, radius.max() + 0.05), abs(path[:, 3]).max() + 0.05
    rows, maps = [], []
    polynomial = dict(degree=SHORT_DEGREE if options.short else DEGREE, reversor="positions")
    fitted = (f"reversible polynomial of degree {polynomial['degree']}", polynomial)
    for name, network in [*NETWORKS.items(), fitted]:
        model, training = seconds(lambda network=network: train(machine, pairs, network, options))
        together = np.resize(starts, (64, 2))
        steps = 20_000 if options.short else 200_000
        _, spent = seconds(lambda model=model: model.predict(together, steps, steps, "ignore"))
        spent /= 64 * steps
        found = model.predict(starts[held], options.periods, outside="ignore")
        one = model.predict(truth[:-1].reshape(-1, 2), outside="ignore")[1].reshape(truth[1:].shape)
        end = model.predict(starts[far], options.long - 200, options.long - 200, "ignore")[1]
        end = model.predict(end, 200, outside="ignore")
        rows.append(
            [
                name,
                f"{len(model.parameters)} numbers",
                f"{rms(one, truth[1:]):.1e} m",
                f"{rms(found[-1], truth[-1]):.1e} m",
                f"{surfaces.off(end):.1e} m",
                f"{1e6 * spent:.3f}",
                f"{making + tracing:.0f} + {training:.1f} s",
                "",
            ]
        )
        maps.append((name, rms(one, truth[1:]), spent, making + tracing + training))
    rivals = []
    for intervals in options.intervals:
        field, building = seconds(lambda intervals=intervals: machine.interpolated(intervals, box))
        rivals.append((f"simsopt, field on {intervals} × {2 * intervals} × {intervals // 2} intervals", field, building))
    rivals.append(("simsopt, field of the coils", machine.field, 0.0))
    for (name, field, building), tolerance in itertools.product(rivals, options.tolerances):
        of_coils = field is machine.field
        here, periods = (truth[:, :2], min(3, options.periods)) if of_coils else (truth, options.periods)
        trace = functools.partial(machine.trace, field, tolerance=tolerance)
        (found, crossings), spent = seconds(lambda trace=trace, here=here, periods=periods: trace(here[0], periods))
        spent /= crossings
        # Each of the first periods from where the line is, as a map does it.
        some = here[: 1 if of_coils else 10].reshape(-1, 2)
        images = here[1 : 2 if of_coils else 11].reshape(-1, 2)
        one, _ = trace(some, 1)
        after, away = "–", "–"
        if not of_coils:
            after = f"{rms(found[-1], truth[-1]):.1e} m"
            end, _ = trace(starts[far], options.long)
            away = f"{surfaces.off(end[-200:]):.1e} m"
        error = rms(one[1], images)
        rows.append([f"{name}, {tolerance:.0e}", "", f"{error:.1e} m", after, away, f"{1e6 * spent:.3g}", f"{building:.0f} s"])
        factors = []
        for of, own, step, paid in maps:
            if own <= error:
                again = max((paid - building) / (spent - step), 0)
                factors.append(f"{spent / step:,.0f} × ({of}), {again:,.0f}")
        rows[-1].append("; ".join(factors))
    head = ["", "", "a period, rms", f"after {options.periods} periods", f"off the surface after {options.long:,}"]
    table([*head, "µs a period and line", "before", "as long as a map of no larger error; periods of lines"], rows)


main()
