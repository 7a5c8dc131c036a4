#!/usr/bin/env python3
"""The map of a storage ring beside tracking element by element, and the table of their errors and times.

    python3 benches/peers/ring.py [cell] [turn] [momenta] [frequency] [aperture] [--turns N] [--pairs N]
        [--iterations N] [--rays N] [--short]

Makes a virtual environment of its own in target/peers (accelerator-toolbox, NumPy and SciPy from PyPI, and this
package as it stands), takes the hybrid multi-bend cell that accelerator-toolbox ships, 32 of which are a ring of 844
m, and lets `gyroceptron.train` learn the map of a cell in the two transverse planes from pairs that tracking makes:
x, y, p_x, p_y on momentum in a ball of the normalised coordinates, of 11 mm along x, denser towards its middle.
Beside it polynomials of least squares on the same pairs, maps that are symplectic by a polynomial generating
function, without and with the mirror symmetry of the midplane, and Taylor maps, as they are and made symplectic.
Compared are a cell of pairs that none has seen, tunes with amplitude, the dynamic aperture by angle, and the time of
a turn of one thread. Then a whole turn of the Australian Synchrotron, 1,333 elements, by symplectic polynomials with
the mirror symmetry. Then a family: the cell at relative momenta that are a control of the map, its error between
them, and the chromaticities. Then a frequency map: a scene on the pairs of the cell, tunes and their changes over a
grid of particles, and the same by tracking. With `aperture`, which has to be named, the aperture after 100,000 turns
by bisection along five rays.

Tracking takes most of the time: eight minutes of one core for 300 turns of 1,430 particles, an hour or two for the
aperture after 100,000.
"""

import argparse
import itertools
import json

import shared
from shared import seconds, table

FOLDER = shared.ROOT / "target" / "peers"
PACKAGES = ["accelerator-toolbox==0.9.0", "numpy", "scipy"]
CELLS = 32
# The ball of the pairs, in metres of x, and the ends of the rays.
RADIUS, LONGEST = 0.011, 0.0135
# Beyond it a particle is lost, in all coordinates.
PIPE = 0.1

shared.enter(FOLDER, PACKAGES)

import contextlib  # noqa: E402
import io  # noqa: E402

import numpy as np  # noqa: E402

with contextlib.redirect_stdout(io.StringIO()):
    import at
from importlib.resources import files  # noqa: E402

import gyroceptron  # noqa: E402


def columns(z):
    """x, y, p_x, p_y of particles of accelerator-toolbox."""
    return np.stack([z[0], z[2], z[1], z[3]], axis=1)


class Cell:
    """A cell or a ring of a file of accelerator-toolbox, its optics at its ends, and tracking through it."""

    def __init__(self, name="hmba.mat"):
        with contextlib.redirect_stdout(io.StringIO()):
            cell = at.load_lattice(str(files("machine_data") / name))
        self.cell = at.Lattice(list(cell), energy=cell.energy, periodicity=1)
        self.cell.disable_6d()
        optics, _, _ = self.cell.get_optics()
        self.beta = np.asarray(optics["beta"])

    def track(self, points, cells=1, delta=0.0, every=None):
        """The points after so many cells; or all states, one in `every`."""
        z = np.zeros((6, len(points)), order="F")
        z[0], z[2], z[1], z[3] = points.T
        z[4] = delta
        if every is None:
            self.cell.track(z, nturns=cells, in_place=True)
            return columns(z)
        states = [columns(z)]
        for _ in range(cells // every):
            self.cell.track(z, nturns=every, in_place=True)
            states.append(columns(z))
        return np.array(states)

    def ball(self, count, seed, radius=RADIUS, power=0.25):
        """Points in a ball of the normalised coordinates: uniform, or with other radii r, of which r^(1/power) is."""
        g = np.random.default_rng(seed)
        v = g.normal(size=(count, 4))
        v *= radius / np.sqrt(self.beta[0]) * g.uniform(size=(count, 1)) ** power / np.linalg.norm(v, axis=1)[:, None]
        return v * np.concatenate([np.sqrt(self.beta), 1 / np.sqrt(self.beta)])

    def distance(self, a, b):
        """Root mean square distance in the normalised coordinates, in metres of x."""
        apart = (a - b) / np.concatenate([np.sqrt(self.beta), 1 / np.sqrt(self.beta)])
        return np.sqrt((apart**2).sum(axis=1).mean() * self.beta[0])

    def form_defect(self, x):
        """The largest entry of the matrix that J^T Omega J misses, in normalised coordinates, at x and a third of it in
        y: by differences of order eight."""
        weights = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
        units = np.concatenate([np.sqrt(self.beta), 1 / np.sqrt(self.beta)])
        steps = 4e-5 * units / units[0]
        ways = np.concatenate([np.arange(1, 5), -np.arange(1, 5)])
        points = np.array([x, x / 3, 0, 0]) + ways[:, None, None] * np.diag(steps)
        image = self.track(points.reshape(-1, 4)).reshape(points.shape)
        slopes = np.tensordot(weights, image[:4] - image[4:], 1).T / steps
        form = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
        return np.abs((slopes.T @ form @ slopes - form) * np.outer(units, units)).max()

    def rays(self, count):
        """Points along rays in the plane of x and y, of as many radii; the radii."""
        radii = np.linspace(0, LONGEST, 111)[1:]
        angles = np.linspace(0, np.pi, count)
        points = np.zeros((count, len(radii), 4))
        points[..., 0] = radii * np.cos(angles)[:, None]
        points[..., 1] = radii * np.sin(angles)[:, None] * np.sqrt(self.beta[1] / self.beta[0])
        return points, radii


class Polynomial:
    """Least squares in products of Chebyshev polynomials of a total degree."""

    table = staticmethod(np.polynomial.chebyshev.chebvander)

    def __init__(self, degree, before, after):
        self.degree, self.scale = degree, np.abs(before).max(axis=0)
        powers = itertools.product(range(degree + 1), repeat=4)
        self.powers = np.array([p for p in powers if sum(p) <= degree])
        self.coefficients, *_ = np.linalg.lstsq(self.terms(before), after, rcond=None)

    def terms(self, z):
        tables = [self.table(z[:, k] / self.scale[k], self.degree) for k in range(4)]
        out = tables[0][:, self.powers[:, 0]]
        for k in range(1, 4):
            out = out * tables[k][:, self.powers[:, k]]
        return out

    def __call__(self, z):
        return self.terms(z) @ self.coefficients

    def survival(self, points, steps):
        """As `Model.survival` has it, for points (N, 4)."""
        lost = np.full(len(points), steps + 1)
        kept, here = np.arange(len(points)), points
        for step in range(1, steps + 1):
            here = self(here)
            stay = (np.abs(here) <= PIPE).all(axis=1)
            lost[kept[~stay]] = step
            kept, here = kept[stay], here[stay]
        return lost


class Taylor(Polynomial):
    """The powers of the coordinates up to a total degree, from a fit of higher degree to a small ball."""

    # In it series converge; in a smaller one rounding would show in high powers.
    RADIUS, MORE = 0.005, 4
    table = staticmethod(np.polynomial.polynomial.polyvander)

    def __init__(self, degree, cell):
        before = cell.ball(8000, 5, self.RADIUS)
        super().__init__(degree + self.MORE, before, cell.track(before))
        kept = self.powers.sum(axis=1) <= degree
        self.degree, self.powers, self.coefficients = degree, self.powers[kept], self.coefficients[kept]


def symplectic_taylor(cell, order):
    """A generating function with the terms of a Taylor series of this order: of pairs that are near the middle."""
    near = cell.ball(4000, 5, 0.003)
    return gyroceptron.SymplecticPolynomial(near, cell.track(near), order + 1, mirrored=[2])


def aperture(survived, steps, radii):
    """The largest radius of each ray up to which all stay."""
    lost = survived <= steps
    first = np.where(lost.any(axis=1), lost.argmax(axis=1), len(radii))
    return np.where(first > 0, radii[first - 1], 0.0)


def on_momentum(cell, options):
    starts = 1 if options.short else 3
    network = dict(kicks=(8, 4, 8), twists=(1, 8, 5), perturbation=(10, 4, 8), starts=starts, validation=0.1)
    before = cell.ball(options.pairs, 1, power=0.5)
    after, making = seconds(lambda: cell.track(before))
    unseen = cell.ball(2000, 2)
    truth = cell.track(unseen)
    # Where motion is regular a turn errs as its cells do.
    inner = cell.ball(2000, 3, 0.5 * RADIUS)
    inner_truth = cell.track(inner, CELLS)
    model, training = seconds(
        lambda: gyroceptron.train(before, after, [[1, 0], [0, 1]], iterations=options.iterations, **network)
    )
    print(f"{len(before)} pairs in {making:.1f} s, training in {training:.1f} s", flush=True)
    maps = [("map of jolts", len(model.parameters), model)]
    plain, mirrored = ([5], [7]) if options.short else ([7, 11], [7, 9, 11, 13, 15])
    for degree, planes in [(degree, []) for degree in plain] + [(degree, [2]) for degree in mirrored]:
        fit = lambda: gyroceptron.SymplecticPolynomial(before, after, degree, mirrored=planes)  # noqa: B023, E731
        one, fitting = seconds(fit)
        name = f"{'mirrored' if planes else 'symplectic'} polynomial of degree {degree}"
        print(f"{name} in {fitting:.1f} s", flush=True)
        maps.append((name, len(one.parameters), one))
    polynomials = [Polynomial(degree, before, after) for degree in ([4, 6] if options.short else [4, 6, 8, 10])]
    maps += [(f"polynomial of degree {one.degree}", one.coefficients.size, one) for one in polynomials]
    for order in [4] if options.short else [4, 6, 8, 10]:
        taylor = Taylor(order, cell)
        maps.append((f"Taylor map of order {order}", taylor.coefficients.size, taylor))
        one = symplectic_taylor(cell, order)
        maps.append((f"Taylor map of order {order}, made symplectic", len(one.parameters), one))
    points, radii = cell.rays(options.rays)
    steps = CELLS * options.turns

    def aperture_of_tracking(points):
        states = cell.track(points.reshape(-1, 4), steps)
        stay = (np.abs(np.nan_to_num(states, nan=np.inf)) <= PIPE).all(axis=1).reshape(points.shape[:2])
        return aperture(np.where(stay, steps + 1, 1), steps, radii)

    own, tracking = seconds(lambda: aperture_of_tracking(points))
    # How well the ring itself has an aperture, at whose edge motion is chaotic.
    near = np.abs(aperture_of_tracking(points + [1e-9, 0, 0, 0]) / own - 1)
    # A fifth of the aperture and more, along x with a little y.
    starts = np.array([[part * RADIUS, 0.1 * part * RADIUS, 0, 0] for part in (0.02, 0.1, 0.2, 0.3, 0.4, 0.5)])
    count = 512 if options.short else 1024
    tunes, changes = gyroceptron.tunes(cell.track(starts, CELLS * count, every=CELLS))
    rows = []
    together = np.repeat(starts[:2], 32, axis=0)
    turn = {}
    for name, numbers, of in maps:
        plain = isinstance(of, Polynomial)
        image = of(unseen) if plain else of.predict(unseen, outside="ignore")[1]
        around = inner
        for _ in range(CELLS if plain else 1):
            around = of(around) if plain else of.predict(around, CELLS, CELLS, "ignore")[1]
        errors = cell.distance(image, truth), cell.distance(around, inner_truth)
        row = [name, f"{numbers}", *(f"{1e6 * error:.2g} µm" for error in errors)]
        if plain:
            orbits, here = [starts], starts
            for step in range(CELLS * count):
                here = of(here)
                if (step + 1) % CELLS == 0:
                    orbits.append(here)
            orbits = np.array(orbits)
        else:
            orbits = of.predict(starts, CELLS * count, CELLS, "ignore")
            # Beside each other, so that a busy machine slows both.
            _, spent = seconds(lambda of=of: of.predict(together, CELLS * 2000, CELLS * 2000, "ignore"))
            _, of_ring = seconds(lambda: cell.track(together, CELLS * 10))
            turn[name] = spent / (64 * 2000), of_ring / (64 * 10)
        apart = gyroceptron.tunes(orbits)[0] - tunes
        row.append(", ".join(f"{v:.1e}" for v in np.abs(apart - apart.round()).max(axis=1)))
        if plain and of.degree == 10:
            rows.append([*row, "–", "–", "–", ""])
            continue
        if plain:
            survived, spent = seconds(lambda of=of: of.survival(points.reshape(-1, 4), steps))
            survived = survived.reshape(points.shape[:2])
        else:
            survived, spent = seconds(lambda of=of: of.survival(points, steps, [-PIPE] * 4, [PIPE] * 4))
        found = aperture(survived, steps, radii)
        change = np.abs(found / own - 1)
        row += [f"{100 * change.mean():.1f} %, {100 * change.max():.1f} %", f"{spent:.1f} s", f"{tracking / spent:.0f} ×"]
        own_turn, of_ring = turn.get(name, (None, None))
        rows.append([*row, f"{1e6 * own_turn:.2f} µs, {of_ring / own_turn:.0f} ×" if own_turn else ""])
    own_changes = ", ".join(f"{v:.1e}" for v in np.abs(changes).max(axis=1))
    bounds = f"{1e3 * own.min():.2f} … {1e3 * own.max():.2f} mm"
    name = "tracking: from the first half of the turns to the second"
    rows.append([name, "", "", "", own_changes, bounds, f"{tracking:.0f} s", "", ""])
    moved = f"{100 * near.mean():.1f} %, {100 * near.max():.1f} %"
    rows.append(["tracking of particles moved by 1 nm", "", "", "", "", moved, "", "", ""])
    head = ["", "numbers", "a cell, rms", f"a turn within {500 * RADIUS:.1f} mm, rms"]
    head += ["tunes differ at 0.2, 1.1, 2.2, 3.3, 4.4 and 5.5 mm by"]
    head += [f"aperture of {options.turns} turns, mean and largest", "time", "as fast"]
    table([*head, "a turn of one of 64, and as fast as tracking beside it"], rows)
    of_map, of_ring = turn["map of jolts"]
    print(
        f"a turn of one of 64 particles, one thread: {1e6 * of_map:.2f} µs by the map of jolts, {1e6 * of_ring:.0f} µs by "
        f"tracking, {of_ring / of_map:.0f} times as long; data and training pay after "
        f"{(making + training) / of_ring:.0f} turns of particles\n",
        flush=True,
    )
    print("Jacobians of tracking through a cell, by differences, are symplectic to")
    amplitudes = (1.1, 2.2, 3.3, 4.4, 5.5)
    print(", ".join(f"{cell.form_defect(1e-3 * a):.1e} at {a} mm" for a in amplitudes) + "\n", flush=True)


def whole_turn(options):
    """A turn of the Australian Synchrotron by symplectic polynomials, of pairs within two radii."""
    ring = Cell("australian_synchrotron.m")
    count, degrees = (1000, [5, 7]) if options.short else (4000, [7, 9, 11])
    rows = []
    for radius in (0.006, 0.012):
        before = ring.ball(count, 1, radius, power=0.5)
        after, making = seconds(lambda: ring.track(before))  # noqa: B023
        unseen = ring.ball(1000, 2, radius)
        truth = ring.track(unseen)
        starts = np.array([[part * radius, 0.3 * part * radius, 0, 0] for part in (0.05, 0.2, 0.35, 0.5)])
        tunes, changes = gyroceptron.tunes(ring.track(starts, 1024, every=1))
        for degree in degrees:
            fit = lambda: gyroceptron.SymplecticPolynomial(before, after, degree, mirrored=[2])  # noqa: B023, E731
            one, fitting = seconds(fit)
            apart = gyroceptron.tunes(one.predict(starts, 1024, 1, "ignore"))[0] - tunes
            together = np.repeat(starts[:2], 32, axis=0)
            _, spent = seconds(lambda: one.predict(together, 2000, 2000, "ignore"))  # noqa: B023
            rows.append([f"{1e3 * radius:.0f} mm", f"{degree}", f"{len(one.parameters)}"])
            rows[-1].append(f"{1e6 * ring.distance(one.predict(unseen, outside='ignore')[1], truth):.2g} µm")
            rows[-1].append(", ".join(f"{v:.1e}" for v in np.abs(apart - apart.round()).max(axis=1)))
            rows[-1] += [f"{making:.1f} s, {fitting:.1f} s", f"{1e6 * spent / 128e3:.2f} µs"]
        own_changes = ", ".join(f"{v:.1e}" for v in np.abs(changes).max(axis=1))
        rows.append([f"{1e3 * radius:.0f} mm", "tracking", "", "", own_changes])
        _, spent = seconds(lambda: ring.track(together, 50))
        rows[-1] += ["", f"{1e6 * spent / 3200:.0f} µs"]
    print(f"a turn of the Australian Synchrotron, {len(ring.cell)} elements, {count} pairs, mirrored polynomials", flush=True)
    head = ["within", "degree", "numbers", "a turn, rms", "tunes of 1,024 turns at 0.05, 0.2, 0.35 and 0.5 of it differ by"]
    table([*head, "pairs and fit", "a turn of one of 64"], rows)


def off_momentum(cell, options):
    network = dict(kicks=(6, 3, 6), twists=(1, 6, 4), perturbation=(8, 3, 6), starts=1, validation=0.15, control_degree=3)
    deltas = np.linspace(-0.02, 0.02, 13)
    count = options.pairs // 8
    before = np.concatenate([cell.ball(count, 10 + k, RADIUS / 2) for k in range(len(deltas))])
    of = np.repeat(deltas, count)
    after = np.concatenate([cell.track(before[of == delta], delta=delta) for delta in deltas])
    model, training = seconds(
        lambda: gyroceptron.train(
            before, after, [[1, 0], [0, 1]], iterations=options.iterations, controls={"delta": of}, **network
        )
    )
    rows = []
    for delta in (-0.0185, -0.0051, 0.0017, 0.0118, 0.0185):
        unseen = cell.ball(1000, 3, RADIUS / 2)
        at_delta = model.at(delta=delta)
        error = cell.distance(at_delta.predict(unseen, outside="ignore")[1], cell.track(unseen, delta=delta))
        rows.append([f"{100 * delta:.2f} %", f"{1e6 * error:.2g} µm"])
    print(f"{len(deltas)} momenta with {count} pairs each, {len(model.parameters)} numbers, training in {training:.1f} s")
    table(["Δp/p, never seen", "a cell, rms"], rows)
    # Of a small amplitude, by differences of tunes.
    step, start = 1e-3, np.array([[2e-5, 1e-5, 0, 0]])

    def tunes_at(delta, states):
        return gyroceptron.tunes(states(delta))[0][0]

    by_map = lambda delta: model.at(delta=delta).predict(start, 1024, outside="ignore")  # noqa: E731
    by_tracking = lambda delta: cell.track(start, 1024, delta=delta, every=1)  # noqa: E731
    found = [(tunes_at(step, way) - tunes_at(-step, way)) / (2 * step) for way in (by_map, by_tracking)]
    words = [", ".join(f"{v:.5f}" for v in values) for values in found]
    print(f"chromaticities of a cell: {words[0]} of the map, {words[1]} by tracking", flush=True)


SCENE = """
name = "ring"
title = "The cell of a storage ring: tunes over a grid of particles"
seed = 1
flow_time = 1.0
plots = ["loss", "frequency-map"]

[data]
pairs = "pairs.npz"
circle_action = [1, 1]
epsilon = 1.0
validation = 0.1

[[models]]
name = "jolts"
weights = {{ kind = "normal", scale = 0.1 }}

[models.network]
kind = "normal-form"
action = [[1, 0], [0, 1]]
kicks = {{ count = 8, width = 4, degree = 8 }}
twists = {{ count = 1, width = 8, degree = 5 }}
perturbation = {{ count = 10, width = 4, degree = 8 }}

[training]
iterations = {iterations}
starts = {{ count = {starts}, iterations = 20 }}
optimiser = {{ kind = "levenberg-marquardt" }}

[frequency_map]
low = [{low[0]}, {low[1]}]
high = [{high[0]}, {high[1]}]
points = [{points[0]}, {points[1]}]
maps = {maps}
"""


def frequency(cell, options):
    """Tunes over a grid of particles, by a scene and by tracking."""
    folder = FOLDER / "ring"
    folder.mkdir(parents=True, exist_ok=True)
    before = cell.ball(options.pairs, 1)
    np.savez(folder / "pairs.npz", input=before, output=cell.track(before))
    high = [0.85 * RADIUS, 0.5 * RADIUS * np.sqrt(cell.beta[1] / cell.beta[0])]
    points, maps = ((6, 5), 512) if options.short else ((40, 30), 1024)
    low = [0.02 * v for v in high]
    starts = 1 if options.short else 3
    scene = SCENE.format(iterations=options.iterations, starts=starts, low=low, high=high, points=points, maps=maps)
    (folder / "ring.toml").write_text(scene)
    gyroceptron.run(folder / "ring.toml", folder / "out", overwrite=True)
    report = json.loads((folder / "out" / "report.json").read_text())
    orbits = report["studies"]["frequency_map"][0]["orbits"]
    start = np.array([[*orbit["start"], 0, 0] for orbit in orbits])
    own = np.array([orbit["tunes"] for orbit in orbits], float)
    change = np.array([orbit["change"] for orbit in orbits], float)
    # In parts, since all states are held.
    parts, tracking = seconds(
        lambda: [gyroceptron.tunes(cell.track(part, maps, every=1)) for part in np.array_split(start, 10)]
    )
    turns, changes = (np.concatenate(each) for each in zip(*parts))
    apart = own - turns
    apart = np.abs(apart - apart.round()).max(axis=1)
    regular = changes.max(axis=1) <= 1e-5
    rows = []
    finite = np.isfinite(apart)
    for name, which in [("of all", finite), ("where tunes change by 1e-5 at most", regular & finite)]:
        quantiles = np.quantile(apart[which], [0.5, 0.9, 1.0]) if which.any() else []
        rows.append([name, f"{which.sum()} of {len(apart)}", *(f"{value:.1e}" for value in quantiles)])
        rows[-1] += ["–"] * (5 - len(rows[-1]))
    table(["orbits", "number", "tunes of a cell differ in the median by", "in nine of ten by", "at most"], rows)
    both = np.isfinite(change) & np.isfinite(changes.max(axis=1))
    alike = (regular == (change <= 1e-5))[both].mean()
    print(
        f"{len(start)} orbits of {maps} cells: {tracking:.0f} s by tracking, with the tunes; map and tracking agree on "
        f"whether tunes change by more than 1e-5 for {100 * alike:.1f} % of the {both.sum()} orbits that have tunes by "
        f"both; by the map {np.isnan(own[:, 0]).sum()} have none, by tracking {np.isnan(turns[:, 0]).sum()}; figure: "
        f"{folder / 'out' / 'frequency-map.svg'}",
        flush=True,
    )


def long_aperture(cell, options):
    """How far particles stay for 100,000 turns, along five rays: by tracking bisection around its aperture of 300 turns,
    by maps the largest radius up to which particles at all of `near` radii around that of tracking stay."""
    rays, halvings, near = 5, 7, 8 if options.short else 48
    few, turns = (5, 50) if options.short else (300, 100_000)
    before = cell.ball(options.pairs, 1, power=0.5)
    after = cell.track(before)
    network = dict(kicks=(8, 4, 8), twists=(1, 8, 5), perturbation=(10, 4, 8), validation=0.1)
    network["starts"] = 1 if options.short else 3
    model = gyroceptron.train(before, after, [[1, 0], [0, 1]], iterations=options.iterations, **network)
    maps = [("map of jolts", model)]
    for degree in [7] if options.short else [11, 13, 15]:
        one = gyroceptron.SymplecticPolynomial(before, after, degree, mirrored=[2])
        maps.append((f"mirrored polynomial of degree {degree}", one))
    for order in [4] if options.short else [8, 10]:
        maps.append((f"Taylor map of order {order}, made symplectic", symplectic_taylor(cell, order)))
    points, radii = cell.rays(rays)

    def stay(points, turns):
        """Whether particles stay, by tracking; followed in parts, since what is lost takes no time."""
        z, done, part = points.copy(), 0, 1000
        while done < turns and not np.isnan(z[:, 0]).all():
            count = min(part, turns - done)
            z = cell.track(z, CELLS * count)
            z[~(np.abs(np.nan_to_num(z, nan=np.inf)) <= PIPE).all(axis=1)] = np.nan
            done += count
        return ~np.isnan(z[:, 0])

    kept = stay(points.reshape(-1, 4), few).reshape(points.shape[:2])
    first = np.where(kept.all(axis=1), len(radii), (~kept).argmax(axis=1))
    short = radii[np.maximum(first - 1, 0)]
    directions = points[:, -1] / radii[-1]

    def bisected(stay):
        low, high = np.zeros(rays), 1.2 * short
        stays_there = stay(high[:, None] * directions)
        middle = 0.85 * short
        for _ in range(halvings):
            kept = stay(middle[:, None] * directions)
            low, high = np.where(kept, middle, low), np.where(kept, high, middle)
            middle = 0.5 * (low + high)
        # Not looked for further out.
        return np.where(stays_there, np.inf, low), (high - low).max()

    rows = []

    def row(name, found, spent, own=None):
        cells = ", ".join(f"{1e3 * value:.2f}" for value in found)
        change = np.abs(found / own - 1) if own is not None else None
        off = "" if own is None else f"{100 * change.mean():.1f} %, {100 * change.max():.1f} %"
        rows.append([name, cells, off, f"{spent:.0f} s"])
        print(" | ".join(rows[-1]), flush=True)

    (own, spacing), tracking = seconds(lambda: bisected(lambda z: stay(z, turns)))
    row(f"tracking, {few} turns", short, 0.0)
    row("tracking", own, tracking)
    around = np.linspace(0.75, 1.2, near) * np.where(np.isfinite(own), own, short)[:, None]
    for name, of in maps:
        starts = around[..., None] * directions[:, None]
        box = [-PIPE] * 4, [PIPE] * 4
        survived, spent = seconds(lambda of=of: of.survival(starts, CELLS * turns, *box))
        lost = survived <= CELLS * turns
        first = np.where(lost.any(axis=1), lost.argmax(axis=1), near)
        # Not looked for further in, nor further out.
        ends = np.concatenate([np.zeros((rays, 1)), around[:, :-1], np.full((rays, 1), np.inf)], axis=1)
        row(name, ends[np.arange(rays), first], spent, own)
    (moved, _), spent = seconds(lambda: bisected(lambda z: stay(z + [1e-9, 0, 0, 0], turns)))
    row("tracking of particles moved by 1 nm", moved, spent, own)
    angles = ", ".join(f"{180 * k / (rays - 1):.0f}" for k in range(rays))
    print(f"\napertures after {turns:,} turns, to {1e3 * spacing:.2f} mm", flush=True)
    table(["", f"along {angles} degrees [mm]", "off by, mean and largest", "time"], rows)


PARTS = ["cell", "turn", "momenta", "frequency"]
LONG = ["aperture"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = f"{', '.join(PARTS)}, where none is named; {', '.join(LONG)}"
    parser.add_argument("parts", nargs="*", default=PARTS, help=parts)
    parser.add_argument("--turns", type=int, default=300, help="turns that a particle has to survive")
    parser.add_argument("--pairs", type=int, default=8000, help="pairs to train with")
    parser.add_argument("--iterations", type=int, default=500)
    parser.add_argument("--rays", type=int, default=13)
    parser.add_argument("--short", action="store_true", help="few of all, to see that it runs")
    options = parser.parse_args()
    if unknown := set(options.parts) - {*PARTS, *LONG}:
        parser.error(f"{', '.join(unknown)}: expected {', '.join([*PARTS, *LONG])}")
    if options.short:
        options.turns, options.pairs, options.iterations, options.rays = 5, 2000, 20, 3
    cell = Cell()
    if "cell" in options.parts:
        on_momentum(cell, options)
    if "turn" in options.parts:
        whole_turn(options)
    if "momenta" in options.parts:
        off_momentum(cell, options)
    if "frequency" in options.parts:
        frequency(cell, options)
    if "aperture" in options.parts:
        long_aperture(cell, options)


main()
