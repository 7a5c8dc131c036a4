#!/usr/bin/env python3
"""Other ways to learn a flow map from the same pairs, on the same cores, and the table of their errors and times.

    python3 benches/peers/learned.py [oscillators] [long-oscillators] [full-orbit] [dissipative] [field-lines]
        [straight-field-lines] [--seeds N] [--starts N] [--iterations N] [--kinds mlp generating field]

Makes a virtual environment of its own in target/peers (JAX, NumPy and SciPy from PyPI), builds the program, makes
pairs and reference orbits, lets `gyroceptron train` learn them, and trains beside it, in JAX by the same kind of
optimiser (Levenberg-Marquardt) with as many parameters or more:

- a multilayer perceptron for what the rotation leaves, which keeps nothing;
- a network for the generating function of the midpoint, symplectic and implicit (Chen and Tao, arXiv:2103.05632,
  in the form that a rotation leaves near the identity);
- a network for the vector field whose flow over one step, by four Runge-Kutta steps, is what the rotation leaves
  (a learnt averaged field, after Bouchereau, Chartier, Lemou and Mehats, arXiv:2208.09222);
- on field lines, Gaussian processes for the generating function: F(theta, P), as in Rath, Albert, Bischl and
  von Toussaint (doi:10.1063/5.0048129), and that of the midpoint; hyperparameters by L-BFGS from three starts.

The rotation is that of the limit; on field lines, where it depends on the radius, a polynomial of the action that is
fitted to the angles of the pairs, as in the program. All rivals are given it. Implicit steps take as many iterations
as their pairs need.

Errors are root mean squares; times of a step are of 64 trajectories together on one core, and of one alone, training of
all cores. No network is told a shorter flow time first: all have these pairs alone. With
`--starts N` all minimise the plain mean square in units of the data (the generating function that of its equation for
the midpoint) and begin from N sets of initial weights a seed, of which that of the least loss after 40 iterations (10
of the averaged field) goes on. Without it the program has its defaults, as for its users: the best of three sets, and
errors of planes weighted by their motion (on field lines one set); those in JAX have one set and the plain mean
square. Of several seeds the medians, and the range of one step, stand below those of each.
"""

import argparse
import contextlib
import json
import os
import pathlib
import subprocess
import sys
import time

import compare

FOLDER = compare.FOLDER
ROOT = compare.ROOT

# ABA(10,6,4) of Blanes et al., doi:10.1016/j.apnum.2013.01.003.
A = [0.03809449742241219, 0.14529871611691375, 0.20762769572554125, 0.43590970365152616]
A += [1 - 2 * sum(A)]
B = [0.09585888083707521, 0.20444615314299878, 0.21707034797899110]
B += [0.5 - sum(B)]
A, B = A + A[-2::-1], B + B[::-1]


class Oscillators:
    """H = (q1^2 + p1^2)/2 + eps (q2^2 + p2^2)/2 + eps q1 q2 sin(2 q1 + 2 q2), a step of time 5."""

    name, dof, time, epsilon = "oscillators", 2, 5.0, 0.01
    options = ["--circle-action", "1,0", "--epsilon", "0.01", "--flow-time", "5"]
    networks = {
        "normal form": ["--kicks", "12x8", "--twists", "16x8"],
        "gyroceptron": ["--architecture", "gyroceptron", "--psi", "10x8", "--near-identity", "10x8"],
    }
    long_steps = [40, 400, 4000]
    # Sets of initial weights of the program, where no number of them is given for all networks.
    starts = 3
    # Of the program only, in the same case.
    own = []
    # Whether the flow is that of a Hamiltonian.
    hamiltonian = True

    def __init__(self, np):
        random = np.random.default_rng(1)
        self.points = random.uniform(-1.2, 1.2, (10_000, 4))
        self.initial = np.tile([[1.0, 0.15, 0.0, 0.0], [0.8, 0.4, 0.3, 0.0], [0.5, 0.9, 0.0, 0.2], [1.1, -0.5, 0.2, 0.3]], (16, 1))

    def turned(self, np, z, share):
        """One point after so much of the rotation of a step."""
        c, s = np.cos(share * self.time), np.sin(share * self.time)
        return np.stack([c * z[0] + s * z[2], z[1], c * z[2] - s * z[0], z[3]])

    def flow(self, np, z, steps=1, count=50):
        """Columns q1, q2, p1, p2; errs by 1e-13."""
        z = np.array(z)
        h = self.time / count

        def turn(time):
            for k, w in ((0, 1.0), (1, self.epsilon)):
                c, s = np.cos(w * time), np.sin(w * time)
                q, p = z[:, k].copy(), z[:, 2 + k].copy()
                z[:, k], z[:, 2 + k] = c * q + s * p, c * p - s * q

        for _ in range(steps * count):
            for k, b in enumerate(B):
                turn(A[k] * h)
                s, c = np.sin(2 * (z[:, 0] + z[:, 1])), np.cos(2 * (z[:, 0] + z[:, 1]))
                common = 2 * z[:, 0] * z[:, 1] * c
                z[:, 2] -= self.epsilon * b * h * (z[:, 1] * s + common)
                z[:, 3] -= self.epsilon * b * h * (z[:, 0] * s + common)
            turn(A[-1] * h)
        return z

    def pairs(self, np):
        return self.points, self.flow(np, self.points)

    def fit_twist(self, np, inputs, outputs):
        """The rotation is known."""

    def energy(self, np, z):
        q1, q2, p1, p2 = (z[..., k] for k in range(4))
        return (q1**2 + p1**2) / 2 + self.epsilon * ((q2**2 + p2**2) / 2 + q1 * q2 * np.sin(2 * q1 + 2 * q2))


class LongOscillators(Oscillators):
    """The same, a step of 32 fast periods: time 200."""

    name, time = "long-oscillators", 200.0
    options = ["--circle-action", "1,0", "--epsilon", "0.01", "--flow-time", "200"]
    networks = {
        "normal form": ["--kicks", "8x8", "--twists", "24x2,12"],
        "normal form, arctan": ["--kicks", "8x8:arctan", "--twists", "24x2,12:arctan"],
    }
    long_steps = [10, 100]

    def flow(self, np, z, steps=1):
        """ABA(10,6,4) in steps of 0.25: errs by 3e-8."""
        return super().flow(np, z, steps, count=800)


class FullOrbit(Oscillators):
    """A charged particle, B = 1 + eps (cos x + cos y) and a potential eps (cos x + sin y)/2; columns Pi_x, Y, Pi_y, X
    with x = X - Pi_y, y = Y + Pi_x. A step of 16 gyrations: time 100."""

    name, time = "full-orbit", 100.0
    options = ["--circle-action", "1,0", "--epsilon", "0.01", "--flow-time", "100"]
    networks = {
        "normal form": ["--kicks", "6x6", "--twists", "24x1,8"],
        "normal form, arctan": ["--kicks", "6x6:arctan", "--twists", "24x1,8:arctan"],
    }
    long_steps = [10, 160]

    def __init__(self, np):
        random = np.random.default_rng(1)
        self.points = random.uniform([-1.0, -0.8, -1.0, -1.6], [1.0, 2.6, 1.0, 1.6], (10_000, 4))
        self.initial = np.tile([[0.3, 1.0, 0.0, 0.0], [0.3, 0.3, 0.0, 0.5], [0.6, 1.0, 0.0, 1.0], [0.9, 0.9, 0.0, 0.3]], (16, 1))

    def field(self, np, z):
        x, y = z[3] - z[2], z[0] + z[1]
        sx, cx, sy, cy = np.sin(x), np.cos(x), np.sin(y), np.cos(y)
        eps = self.epsilon
        vx, vy = z[0] + eps * sy, z[2] - eps * sx
        by_x, by_y = eps * (-cx * vy - sx / 2), eps * (cy * vx + cy / 2)
        return np.stack([vy - by_x, by_x, -vx - by_y, -by_y])

    def flow(self, np, z, steps=1):
        """Dormand and Prince's method of order 8, relative errors of 1e-12 a step."""
        from scipy.integrate import solve_ivp

        shape = np.shape(np.transpose(z))
        by_time = lambda _, flat: self.field(np, flat.reshape(shape)).ravel()
        found = solve_ivp(
            by_time, (0.0, self.time * steps), np.transpose(z).ravel(), method="DOP853", rtol=1e-12, atol=1e-13,
            t_eval=[self.time * steps],
        )
        return found.y[:, -1].reshape(shape).T

    def energy(self, np, z):
        x, y = z[..., 3] - z[..., 2], z[..., 0] + z[..., 1]
        vx, vy = z[..., 0] + self.epsilon * np.sin(y), z[..., 2] - self.epsilon * np.sin(x)
        return (vx**2 + vy**2) / 2 + self.epsilon * (np.cos(x) + np.sin(y)) / 2


class Dissipative(FullOrbit):
    """Van der Pol's oscillator and a slow damped one that holds it back, a step of time 50: not Hamiltonian, so that it
    has no generating function."""

    name, time = "dissipative", 50.0
    options = ["--circle-action", "1,0", "--epsilon", "0.01", "--flow-time", "50"]
    networks = {
        "couplings": ["--architecture", "coupling-gyroceptron", "--psi", "2x8", "--near-identity", "16x8"],
    }
    long_steps = [8, 80, 800]
    hamiltonian = False

    def __init__(self, np):
        random = np.random.default_rng(1)
        self.points = random.uniform([-2.5, -1.7, -2.5, -2.3], [2.5, 2.7, 2.5, 2.4], (10_000, 4))
        orbits = [[1.0, 0.3, 0.0, 0.0], [2.0, 1.0, 0.0, 0.5], [0.3, 0.0, 0.2, 0.0], [1.5, -0.8, 0.5, 0.6]]
        self.initial = np.tile(orbits, (16, 1))

    def field(self, np, z):
        q1, q2, p1, p2 = z
        excited, driven = (1 - q1**2 - q2) * p1, q1**2 / 2 - q2 - 0.3 * p2
        return np.stack([p1, self.epsilon * p2, self.epsilon * excited - q1, self.epsilon * driven])


class FieldLines:
    """H = iota (r^2/2 - r^4/4)(1 + eps cos(2 phi - 3 theta)) around a circular axis, a turn."""

    name, dof, time, epsilon = "field-lines", 1, 6.283185307179586, 1e-3
    hamiltonian, starts = True, 1
    options = ["--circle-action", "1", "--epsilon", "0.001"]
    own = ["--units", "data"]
    networks = {
        "nearly integrable, polynomials": [
            "--architecture", "normal-form", "--kicks", "10x1^16", "--twists", "1x1^10", "--perturbation", "10x1^16",
            "--iterations", "400",
        ]
    }
    long_steps = [100, 10_000]
    iota, aspect = 2 / 5**0.5, 2.0

    def __init__(self, np):
        random = np.random.default_rng(1)
        radii, angles = np.sqrt(random.uniform(0.01, 0.81, 64)), random.uniform(0, 2 * np.pi, 64)
        orbits = [self.canonical(np, np.stack([radii, angles], axis=1))]
        for _ in range(94):
            orbits.append(self.flow(np, orbits[-1]))
        self.orbits = np.array(orbits)
        radii = np.linspace(0.15, 0.85, 16)
        self.initial = np.repeat(self.canonical(np, np.stack([radii, 0 * radii], axis=1)), 4, axis=0)

    def fit_twist(self, np, inputs, outputs):
        """The angle of a turn as a polynomial of the action, highest power first; angles are followed outwards."""
        (before, action), (after, _) = (self.angle_and_action(np, z) for z in (inputs, outputs))
        order = np.argsort(action)
        gone, action = np.mod(after - before, 2 * np.pi)[order], action[order]
        # That of the innermost pairs is within half a turn of the rotation at the axis.
        mean = self.iota * self.time
        for k in range(len(gone)):
            gone[k] += 2 * np.pi * np.round((mean - gone[k]) / (2 * np.pi))
            mean = 0.98 * mean + 0.02 * gone[k]
        fitted = np.polynomial.Chebyshev.fit(action, gone, 10)
        self.twist = fitted.convert(kind=np.polynomial.Polynomial).coef[::-1]

    @staticmethod
    def angle_and_action(np, z):
        return np.arctan2(z[:, 0], z[:, 1]), 0.5 * (z**2).sum(axis=1)

    def turned(self, np, z, share):
        """One point after so much of the rotation of a step."""
        action, angle = 0.5 * (z[0] ** 2 + z[1] ** 2), 0.0
        for c in self.twist:
            angle = angle * action + c
        c, s = np.cos(share * angle), np.sin(share * angle)
        return np.stack([c * z[0] + s * z[1], c * z[1] - s * z[0]])

    def canonical(self, np, x):
        length = x[:, 0] * np.sqrt(1 - 2 / 3 * x[:, 0] / self.aspect * np.cos(x[:, 1]))
        return np.stack([length * np.sin(x[:, 1]), length * np.cos(x[:, 1])], axis=1)

    def polar(self, np, z):
        p = z[:, 1] / self.aspect
        u = 1 + p / 3
        for _ in range(8):
            u = u - (u * u * (1 - 2 / 3 * p * u) - 1) / (2 * u * (1 - p * u))
        return np.stack([np.hypot(z[:, 0], z[:, 1]) * u, np.arctan2(z[:, 0], z[:, 1])], axis=1)

    def field(self, np, x, phi):
        r, theta = x[:, 0], x[:, 1]
        phase = 2 * phi - 3 * theta
        wave = 1 + self.epsilon * np.cos(phase)
        f, slope = self.iota * (r**2 / 2 - r**4 / 4), self.iota * (r - r**3)
        by_theta = 3 * self.epsilon * f * np.sin(phase)
        p_r = r - r**2 * np.cos(theta) / self.aspect
        # At fixed r: what theta does to p_theta cancels against what it does to H at fixed p_theta.
        return np.stack([-by_theta / p_r, slope * wave / p_r], axis=1)

    def flow(self, np, z, steps=1):
        """Runge-Kutta 4 of 400 steps a turn in (r, theta): errs by 1e-10."""
        x = self.polar(np, np.array(z))
        count = 400
        h = self.time / count
        for k in range(steps * count):
            phi = k * h
            k1 = self.field(np, x, phi)
            k2 = self.field(np, x + h / 2 * k1, phi + h / 2)
            k3 = self.field(np, x + h / 2 * k2, phi + h / 2)
            k4 = self.field(np, x + h * k3, phi + h)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return self.canonical(np, x)

    def pairs(self, np):
        return self.orbits[:-1].reshape(-1, 2), self.orbits[1:].reshape(-1, 2)


class StraightFieldLines(FieldLines):
    """The same lines in coordinates in which those of eps = 0 turn evenly about the origin: J = r^2/2 and the angle
    Theta = theta - (r/aspect) sin(theta), which have a closed form here."""

    name = "straight-field-lines"

    def canonical(self, np, x):
        angle = x[:, 1] - x[:, 0] / self.aspect * np.sin(x[:, 1])
        return np.stack([x[:, 0] * np.sin(angle), x[:, 0] * np.cos(angle)], axis=1)

    def polar(self, np, z):
        r, angle = np.hypot(z[:, 0], z[:, 1]), np.arctan2(z[:, 0], z[:, 1])
        theta = angle.copy()
        for _ in range(30):
            shift = r / self.aspect
            theta = theta - (theta - shift * np.sin(theta) - angle) / (1 - shift * np.cos(theta))
        return np.stack([r, theta], axis=1)


def mlp_shape(inputs, outputs, parameters):
    """Two hidden layers of one width, with as many parameters or a few more."""
    width = 1
    while inputs * width + width + width * width + width + width * outputs + outputs < parameters:
        width += 1
    return [(inputs, width), (width, width), (width, outputs)]


class Learned:
    """A model in JAX: parameters in one vector, a map, a residual."""

    def __init__(self, case, kind, parameters, seed):
        import jax
        import jax.numpy as jnp
        import numpy as np

        self.jnp, self.case, self.kind = jnp, case, kind
        dim = 2 * case.dof
        outputs = 1 if kind == "generating" else dim
        self.shape = mlp_shape(dim, outputs, parameters)
        random = np.random.default_rng(seed)
        flat = []
        for rows, columns in self.shape:
            flat += [random.normal(0, (2 / (rows + columns)) ** 0.5, rows * columns), np.zeros(columns)]
        # The last layer begins small: the map is then the rotation, nearly.
        flat[-2] *= 0.1
        self.flat = jnp.asarray(np.concatenate(flat))
        self.activations = sum(columns for _, columns in self.shape[:-1])
        n = case.dof
        omega = np.zeros((dim, dim))
        omega[:n, n:], omega[n:, :n] = np.eye(n), -np.eye(n)
        self.omega = jnp.asarray(omega)

    def network(self, flat, z):
        jnp, at = self.jnp, 0
        for number, (rows, columns) in enumerate(self.shape):
            w = flat[at : at + rows * columns].reshape(rows, columns)
            b = flat[at + rows * columns : at + rows * columns + columns]
            at += rows * columns + columns
            z = z @ w + b
            if number + 1 < len(self.shape):
                z = jnp.tanh(z)
        return z

    def field(self, flat, z):
        """Omega times the gradient of the generating function."""
        import jax

        return self.omega @ jax.grad(lambda w: self.network(flat, w)[0])(z)

    def step(self, flat, z):
        """One point."""
        turned = lambda z, share: self.case.turned(self.jnp, z, share)
        if self.kind == "mlp":
            return turned(z, 1.0) + self.network(flat, z)
        if self.kind == "field":
            w, h = z, 0.25
            for _ in range(4):
                k1 = self.network(flat, w)
                k2 = self.network(flat, w + h / 2 * k1)
                k3 = self.network(flat, w + h / 2 * k2)
                k4 = self.network(flat, w + h * k3)
                w = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            return turned(w, 1.0)
        return between_half_rotations(self.jnp, self.case, lambda w: self.field(flat, w), z, self.iterations)

    def settle(self, points):
        """Takes as many iterations in each step as these points need."""
        if self.kind == "generating":
            field = lambda w: self.field(self.flat, w)
            self.iterations = iterations_needed(self.jnp, self.case, field, points)

    def residual(self, flat, z, target):
        if self.kind != "generating":
            return self.step(flat, z) - target
        # Of pairs the midpoint is known: nothing is implicit.
        w, moved = self.case.turned(self.jnp, z, 0.5), self.case.turned(self.jnp, target, -0.5)
        return moved - w - self.field(flat, 0.5 * (w + moved))


# The last change of an implicit step; and the most iterations.
LAST_CHANGE, MOST_ITERATIONS = 1e-13, 100


def between_half_rotations(jnp, case, field, z, iterations):
    """w' = w + Omega grad S((w + w')/2) between two half rotations, by iterations to rounding."""
    w = case.turned(jnp, z, 0.5)
    moved = w
    for _ in range(iterations):
        moved = w + field(0.5 * (w + moved))
    return case.turned(jnp, moved, 0.5)


def iterations_needed(jnp, case, field, points):
    """How many iterations bring the last change of all these points below LAST_CHANGE."""
    import jax

    w = jax.vmap(lambda z: case.turned(jnp, z, 0.5))(jnp.asarray(points))
    fields = jax.jit(jax.vmap(field))
    moved = w
    for count in range(1, MOST_ITERATIONS + 1):
        before, moved = moved, w + fields(0.5 * (w + moved))
        if float(jnp.abs(moved - before).max()) <= LAST_CHANGE:
            return count
    return MOST_ITERATIONS


def levenberg_marquardt(model, inputs, outputs, iterations):
    """Minimises the mean square of the residuals; returns the sum of their squares."""
    import jax
    import jax.numpy as jnp
    import jax.scipy.linalg as linalg

    chunk = max(size for size in range(1, 501) if len(inputs) % size == 0)
    parts = jnp.asarray(inputs.reshape(-1, chunk, inputs.shape[1]))
    targets = jnp.asarray(outputs.reshape(-1, chunk, inputs.shape[1]))
    one = jax.vmap(model.residual, in_axes=(None, 0, 0))
    slopes = jax.vmap(jax.jacrev(model.residual), in_axes=(None, 0, 0))

    @jax.jit
    def loss(flat):
        return jax.lax.map(lambda part: jnp.sum(one(flat, *part) ** 2), (parts, targets)).sum()

    @jax.jit
    def normal(flat):
        def body(sums, part):
            r = one(flat, *part).reshape(-1)
            j = slopes(flat, *part).reshape(r.shape[0], -1)
            return (sums[0] + j.T @ j, sums[1] + j.T @ r, sums[2] + r @ r), None

        p = flat.shape[0]
        return jax.lax.scan(body, (jnp.zeros((p, p)), jnp.zeros(p), jnp.zeros(())), (parts, targets))[0]

    @jax.jit
    def solve(matrix, gradient, damping):
        scale = jnp.diag(matrix) + 1e-12 * jnp.max(jnp.diag(matrix))
        factor = linalg.cho_factor(matrix + damping * jnp.diag(scale))
        return linalg.cho_solve(factor, gradient)

    flat, damping = model.flat, 1e-3
    for _ in range(iterations):
        matrix, gradient, value = normal(flat)
        for _ in range(30):
            candidate = flat - solve(matrix, gradient, damping)
            if loss(candidate) < value:
                flat, damping = candidate, max(damping / 5, 1e-14)
                break
            damping *= 4
        else:
            break
    model.flat = flat
    return float(loss(flat))


# Iterations of each start, as in the program.
OF_A_START = 40


def train(case, kind, parameters, seed, options, pairs):
    """A model that is trained from the best of some sets of initial weights."""
    import numpy as np

    # Sixteen evaluations of its network a step: a quarter of the iterations take four times as long.
    fewer = 4 if kind == "field" else 1
    starts = options.starts or 1
    models = [Learned(case, kind, parameters, seed * starts + start) for start in range(starts)]
    best = 0
    if len(models) > 1:
        losses = np.array([levenberg_marquardt(model, *pairs, OF_A_START // fewer) for model in models])
        best = np.where(np.isfinite(losses), losses, np.inf).argmin()
    levenberg_marquardt(models[best], *pairs, options.iterations // fewer)
    return models[best]


@contextlib.contextmanager
def one_core():
    """All threads of the process on one core, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    threads = {int(thread): os.sched_getaffinity(int(thread)) for thread in os.listdir("/proc/self/task")}

    def settle(of):
        for thread in threads:
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(thread, of(thread))

    first = min(threads[os.getpid()])
    settle(lambda _: {first})
    try:
        yield
    finally:
        settle(lambda thread: threads[thread])


def rms(np, difference):
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=-1))))


def judged(np, case, orbits, reference):
    """Distances over the first steps and over all, and from the orbits of the reference, for the report."""
    cells = []
    for steps in case.long_steps:
        if len(orbits) <= steps:
            cells.append("-")
            continue
        found = orbits[: steps + 1]
        ok = np.isfinite(found).all() and np.abs(found).max() < 10
        cells.append(f"{rms(np, found - reference[: steps + 1]):.1e}" if ok else "lost")
    return cells


def invariant_drift(np, case, orbits):
    """How far the energy has gone at the end, over its mean among the orbits; of field lines, r on the section."""
    if len(orbits) <= case.long_steps[-1] or not case.hamiltonian:
        return "-"
    if case.dof > 1:
        energy = case.energy(np, orbits)
        return f"{np.abs(energy[-(1 + len(orbits) // 40) :] - energy[0]).max() / energy[0].mean():.1e}"
    from scipy.spatial import cKDTree

    # The last points of each line from all those of the reference on its surface.
    worst = []
    for line in range(0, orbits.shape[1], 4):
        tree = cKDTree(case.surfaces[:, line])
        last = orbits[-500:, line]
        worst.append(np.inf if not np.isfinite(last).all() else tree.query(last)[0].max())
    return f"{np.median(worst):.1e}, {max(worst):.1e}"


def medians(np, name, rows):
    """Prints the medians over the rows of several seeds, and the range of the error of one step."""
    if len(rows) < 2:
        return

    def median(cells):
        # What is lost is further off than anything that is not.
        numbers = [np.inf if cell == "lost" else float(cell) for cell in cells]
        middle = np.median(numbers)
        if not np.isfinite(middle):
            return "lost"
        return f"{middle:.1e}" if middle < 0.01 else f"{middle:.3g}"

    _, parameters, *columns = zip(*rows)
    cells = [median(column) if all("," not in cell and cell != "-" for cell in column) else "" for column in columns]
    ends = sorted(columns[0], key=lambda cell: np.inf if cell == "lost" else float(cell))
    cells[0] += f" ({ends[0]} to {ends[-1]})"
    print("| " + " | ".join([f"{name}, medians of {len(rows)} seeds", parameters[0], *cells]) + " |", flush=True)


class GaussianProcess:
    """A generating function on the plane whose gradients at some points are known, as the mean of a Gaussian process.

    Of kind "midpoint" that of w' = w + Omega grad S((w + w')/2) between two half rotations, with a kernel that falls
    with the square of the distance; of kind "angle-action" what F(theta, P) has beside that of the rotation, where
    p = P + dF/dtheta and theta' = theta + dF/dP, with a kernel of sin((theta - theta')/2) and of P - P'.
    """

    def __init__(self, np, case, kind, inputs, outputs):
        import jax
        import jax.numpy as jnp
        import jax.scipy.linalg as linalg
        from scipy.optimize import minimize

        self.case, self.kind, self.jnp = case, kind, jnp
        if kind == "midpoint":
            w = np.stack([case.turned(np, z, 0.5) for z in inputs])
            moved = np.stack([case.turned(np, z, -0.5) for z in outputs])
            places, change = 0.5 * (w + moved), moved - w
            slopes = np.stack([-change[:, 1], change[:, 0]], axis=1)
        else:
            (q, p), (big_q, big_p) = case.angle_and_action(np, inputs), case.angle_and_action(np, outputs)
            turn = np.polyval(case.twist, big_p)
            gone = big_q - q - turn
            gone -= 2 * np.pi * np.round(gone / (2 * np.pi))
            places, slopes = np.stack([q, big_p], axis=1), np.stack([p - big_p, gone], axis=1)
        self.places, count = jnp.asarray(places), len(places)
        y = jnp.asarray(slopes.reshape(-1))

        def kernel(x, y, lengths):
            d = x - y
            if kind == "midpoint":
                return jnp.exp(-0.5 * jnp.sum((d / lengths) ** 2))
            return jnp.exp(-0.5 * (2 * jnp.sin(d[0] / 2) / lengths[0]) ** 2 - 0.5 * (d[1] / lengths[1]) ** 2)

        self.kernel = kernel
        block = jax.jacfwd(jax.grad(kernel, argnums=0), argnums=1)
        blocks = jax.vmap(jax.vmap(block, in_axes=(None, 0, None)), in_axes=(0, None, None))

        def covariance(log):
            k = blocks(self.places, self.places, jnp.exp(log[:2])).transpose(0, 2, 1, 3).reshape(2 * count, 2 * count)
            return jnp.exp(log[2]) * (k + jnp.exp(log[3]) * jnp.diag(jnp.diag(k)))

        @jax.jit
        @jax.value_and_grad
        def likelihood(log):
            factor = jnp.linalg.cholesky(covariance(log))
            return 0.5 * y @ linalg.cho_solve((factor, True), y) + jnp.log(jnp.diag(factor)).sum()

        def value_and_slope(log):
            value, slope = likelihood(log)
            if not (np.isfinite(value) and np.isfinite(slope).all()):
                return 1e25, np.zeros(4)
            return float(value), np.asarray(slope)

        # Below 1e-13 of the diagonal no factor is found.
        bounds = [(-5.0, 3.0), (-5.0, 3.0), (-40.0, 20.0), (np.log(1e-13), 0.0)]
        across = np.log(places.std(axis=0))
        starts = [np.array([*(across + shift), np.log(slopes.var()), np.log(1e-8)]) for shift in (-0.7, 0.3, 1.0)]
        tried = [
            minimize(value_and_slope, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60})
            for start in starts
        ]
        best = min(tried, key=lambda found: found.fun)
        if not best.fun < 1e25:
            sys.exit(f"{case.name}: no hyperparameters of a Gaussian process were found")
        factor = jnp.linalg.cholesky(covariance(best.x))
        self.lengths = jnp.exp(best.x[:2])
        self.weights = jnp.exp(best.x[2]) * linalg.cho_solve((factor, True), y).reshape(count, 2)
        # What is learnt is the gradient of this.
        each = jax.vmap(
            lambda x, place, weight: jax.jvp(lambda at: kernel(x, at, self.lengths), (place,), (weight,))[1],
            in_axes=(None, 0, 0),
        )
        self.slope = jax.grad(lambda x: each(x, self.places, self.weights).sum())
        if kind == "midpoint":
            self.iterations = iterations_needed(jnp, case, self.field, inputs)
        else:
            self.iterations = self.newton_needed(inputs)

    def field(self, w):
        """Omega times the gradient of the generating function of the midpoint."""
        by_q, by_p = self.slope(w)
        return self.jnp.stack([by_p, -by_q])

    def newton(self, z, iterations):
        """The angle q, the new action P of q and p, and the last change of Newton's method."""
        import jax

        jnp = self.jnp
        q, p = jnp.arctan2(z[0], z[1]), 0.5 * (z**2).sum()

        def off(new):
            return new + self.slope(jnp.stack([q, new]))[0] - p

        new, change = p, 0.0
        for _ in range(iterations):
            value, slope = jax.jvp(off, (new,), (jnp.ones(()),))
            before, new = new, jnp.clip(new - value / slope, 1e-6, 0.6)
            change = jnp.abs(new - before)
        return q, new, change

    def newton_needed(self, points):
        """How many iterations bring the last change of nearly all these points below LAST_CHANGE."""
        import jax

        points = self.jnp.asarray(points)
        for count in range(1, 9):
            changes = jax.jit(jax.vmap(lambda z, count=count: self.newton(z, count)[2]))(points)
            # Across the section there may be no solution for some.
            if float(self.jnp.quantile(changes, 0.99)) <= LAST_CHANGE:
                return count
        return 8

    def step(self, z):
        """One point."""
        jnp = self.jnp
        if self.kind == "midpoint":
            return between_half_rotations(jnp, self.case, self.field, z, self.iterations)
        q, new, _ = self.newton(z, self.iterations)
        moved = q + self.slope(jnp.stack([q, new]))[1] + jnp.polyval(jnp.asarray(self.case.twist), new)
        r = jnp.sqrt(2 * new)
        return jnp.stack([r * jnp.sin(moved), r * jnp.cos(moved)])


def program(case, name, options, folder, np):
    """What the program makes of the pairs: seconds of training, its report's figures, orbits, seconds of a step of 64
    trajectories and of one alone."""
    binary = ROOT / "target" / "release" / "gyroceptron"
    model = folder / f"{name.replace(' ', '-').replace(',', '')}.json"
    command = [binary, "train", "--data", folder / "pairs.npz", "--output", model, "--overwrite", "--json", *case.options, *options]
    start = time.perf_counter()
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    seconds = time.perf_counter() - start
    if done.returncode not in (0, 1):
        sys.exit(done.stderr)
    steps = case.long_steps[-1]
    predict = [binary, "predict", "--model", model, "--input", folder / "initial.npy", "--steps", steps, "--every", "1",
               "--output", folder / "orbits.npy", "--overwrite", "--outside", "ignore", "--threads", "1"]
    rolled = subprocess.run([str(part) for part in predict], capture_output=True, text=True)
    if rolled.returncode != 0:
        sys.exit(rolled.stderr)

    def seconds_a_step(points, few, more):
        """Of steps whose states are all kept, without what the program takes to begin; NaN where an orbit is lost."""
        timed = [*predict]
        for place, value in (("--input", points), ("--output", folder / "timed.npy")):
            timed[timed.index(place) + 1] = value
        found = []
        for count in (few, more):
            timed[timed.index("--steps") + 1] = count
            start = time.perf_counter()
            if subprocess.run([str(part) for part in timed], capture_output=True).returncode != 0:
                return np.nan
            found.append(time.perf_counter() - start)
        return (found[1] - found[0]) / (more - few)

    together = seconds_a_step(folder / "initial.npy", 1000, 9000) / 64
    alone = seconds_a_step(folder / "first.npy", 1000, 101_000)
    once = [*predict]
    once[once.index("--input") + 1], once[once.index("--steps") + 1] = folder / "held-out.npy", 1
    once[once.index("--output") + 1] = folder / "step.npy"
    subprocess.run([str(part) for part in once], check=True, capture_output=True)
    parameters = len(json.loads(model.read_text())["parameters"])
    return seconds, np.load(folder / "step.npy")[-1], np.load(folder / "orbits.npy"), together, alone, parameters


def check_symplectic(case, points, np):
    """Ends unless the flow that makes the pairs keeps the form, by central differences."""
    h, n = 1e-5, case.dof
    omega = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    for z in points:
        around = np.concatenate([z + h * np.eye(2 * n), z - h * np.eye(2 * n)])
        moved = case.flow(np, around)
        jacobian = ((moved[: 2 * n] - moved[2 * n :]) / (2 * h)).T
        defect = np.abs(jacobian.T @ omega @ jacobian - omega).max()
        if not defect < 1e-6:
            sys.exit(f"{case.name}: the pairs are of no symplectic map, by {defect:.1e} at {z}")


def run(case, options, np):
    folder = FOLDER / "learned" / case.name
    folder.mkdir(parents=True, exist_ok=True)
    inputs, outputs = case.pairs(np)
    if case.hamiltonian:
        check_symplectic(case, inputs[:: len(inputs) // 5], np)
    order = np.random.default_rng(2).permutation(len(inputs))
    inputs, outputs = inputs[order], outputs[order]
    held = len(inputs) // 10
    case.fit_twist(np, inputs[held:], outputs[held:])
    np.savez(folder / "pairs.npz", input=inputs[held:], output=outputs[held:])
    np.save(folder / "held-out.npy", inputs[:held])
    np.save(folder / "initial.npy", case.initial)
    np.save(folder / "first.npy", case.initial[:1])
    reference = [case.initial]
    for _ in range(case.long_steps[-1]):
        reference.append(case.flow(np, reference[-1]))
    reference = np.array(reference)
    case.surfaces = reference
    drift = "surface, median and largest" if case.dof == 1 else "energy at the end"
    lengths = " | ".join(f"{steps:,} steps" for steps in case.long_steps)
    print(f"\n{case.name}: {len(inputs) - held:,} pairs of a step of time {case.time:.4g}\n")
    print(f"| learnt | parameters | one step | {lengths} | {drift} | seconds of training | µs a step | one alone |")
    print("|---|---|" + "---|" * (len(case.long_steps) + 5), flush=True)

    def row(name, parameters, step, orbits, seconds, micro, alone):
        one = f"{rms(np, step - outputs[:held]):.1e}" if np.isfinite(step).all() else "lost"
        cells = [name, parameters, one, *judged(np, case, orbits, reference), invariant_drift(np, case, orbits)]
        cells = [str(cell) for cell in cells] + [f"{seconds:.0f}", f"{micro:.2g}", f"{alone:.2g}"]
        print("| " + " | ".join(cells) + " |", flush=True)
        return cells

    most = 0
    for name, arguments in case.networks.items():
        rows = []
        own = ["--loss-weights", "none", "--units", "data"] if options.starts else case.own
        for seed in range(options.seeds):
            seeded = [*arguments, *own, "--seed", seed, "--starts", options.starts or case.starts]
            seconds, step, orbits, together, alone, parameters = program(case, name, seeded, folder, np)
            most = max(most, parameters or 0)
            called = f"`gyroceptron`, {name}, seed {seed}"
            rows.append(row(called, parameters, step, orbits, seconds, 1e6 * together, 1e6 * alone))
        medians(np, f"`gyroceptron`, {name}", rows)

    import jax
    import jax.numpy as jnp

    def followed(name, parameters, step, seconds, count=case.long_steps[-1]):
        """A map of one point in JAX, its orbits and how long a step of them takes."""
        steps = jax.vmap(step)

        def body(w, _):
            w = steps(w)
            return w, w

        def timed(begins):
            compiled = jax.jit(lambda z: jax.lax.scan(body, z, None, length=count)[1]).lower(begins).compile()
            with one_core():
                start = time.perf_counter()
                found = compiled(begins).block_until_ready()
            return found, 1e6 * (time.perf_counter() - start) / (count * len(begins))

        found, micro = timed(jnp.asarray(case.initial))
        _, alone = timed(jnp.asarray(case.initial[:1]))
        orbits = np.concatenate([case.initial[None], np.asarray(found)])
        return row(name, parameters, np.asarray(jax.jit(steps)(jnp.asarray(inputs[:held]))), orbits, seconds, micro, alone)

    names = {"mlp": "perceptron", "generating": "generating function", "field": "averaged field"}
    for kind in options.kinds:
        name = names[kind]
        if kind == "generating" and not case.hamiltonian:
            continue
        rows = []
        for seed in range(options.seeds):
            start = time.perf_counter()
            model = train(case, kind, most, seed, options, (inputs[held:], outputs[held:]))
            seconds = time.perf_counter() - start
            model.settle(inputs[held:])
            step = lambda z, model=model: model.step(model.flat, z)
            rows.append(followed(f"{name} (JAX), seed {seed}", len(model.flat), step, seconds))
        medians(np, f"{name} (JAX)", rows)

    if case.dof == 1:
        kinds = {"angle-action": "F(theta, P)", "midpoint": "the midpoint's"}
        for kind, count in ((kind, count) for kind in kinds for count in (250, 1000)):
            start = time.perf_counter()
            process = GaussianProcess(np, case, kind, inputs[held : held + count], outputs[held : held + count])
            seconds = time.perf_counter() - start
            name = f"Gaussian process, {kinds[kind]}, {count} pairs (JAX)"
            # Long orbits by the larger one would take a quarter of an hour.
            steps = case.long_steps[-1 if count == 250 else 0]
            followed(name, f"{2 * count} weights", process.step, seconds, steps)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, help="initial weights of each network")
    starts = f"sets of initial weights a seed, {OF_A_START} iterations each, of all networks"
    parser.add_argument("--starts", type=int, help=starts)
    parser.add_argument("--iterations", type=int, default=200, help="of Levenberg-Marquardt in JAX")
    parser.add_argument("--kinds", nargs="+", default=["mlp", "generating", "field"], choices=["mlp", "generating", "field"])
    cases = (Oscillators, LongOscillators, FullOrbit, Dissipative, FieldLines, StraightFieldLines)
    names = ", ".join(case.name for case in cases)
    parser.add_argument("cases", nargs="*", help=f"{names}; all, where none is named")
    options = parser.parse_args()
    unknown = set(options.cases) - {case.name for case in cases}
    if unknown:
        parser.error(f"expected some of {names}, found {', '.join(sorted(unknown))}")
    import jax

    jax.config.update("jax_enable_x64", True)
    import numpy as np

    subprocess.run(["cargo", "build", "--release", "--quiet", "--locked"], check=True, cwd=ROOT)
    for case in cases:
        if not options.cases or case.name in options.cases:
            run(case(np), options, np)
    return 0


if __name__ == "__main__":
    compare.environment()
    sys.exit(main())
