"""Makes the pairs of two real systems that the tests train on, and what they judge the networks
by. Of each, NAME being `three-body` or `spring-pendulum`, there are beside this file:

    NAME.npz          `input` and `output`, (1000, 4): pairs of the time-h map of the flow
    NAME-check.npz    300 pairs of other points
    NAME-orbits.npy   (101, 8, 4): each tenth of 1000 iterates of 8 points

Columns are q1 q2 p1 p2. To make them again:

    pip install rebound scipy numpy
    python tests/data/make_real.py [FOLDER]

three-body: the planar restricted three-body problem, by REBOUND's IAS15. G = 1, a star of
mass 1 and a planet of mass m = 1e-3 on a circle of radius 1; h is the planet's period. A test
particle inside (a near 0.38) goes round 4.27 times in h. Poincare's canonical variables of its
osculating orbit about the star: with L = sqrt(a), l the mean longitude, w the longitude of the
pericentre and G = L (1 - sqrt(1 - e^2)),

    q1, p1 = sqrt(2 L) (cos l, -sin l)       fast and wide: |z| is near 1.11
    q2, p2 = sqrt(2 G) (cos w, -sin w)       slow and narrow: |z| is below 0.09

spring-pendulum: a mass 1 on a spring of stiffness 900 and rest length 1 under the gravity 1, by
SciPy's DOP853, h = 0.35. With r the length at rest under the load and R = r + x,

    q1, p1 = x sqrt(30), pR / sqrt(30)       fast: 30 radians a unit of time
    q2, p2 = the angle from below, its angular momentum      slow: about 1 radian
"""

import pathlib
import sys

import numpy as np

MASS = 1e-3
STIFFNESS, SPRING_TIME = 900.0, 0.35


def particles(z):
    """Positions and velocities (N, 4) of Poincare's variables."""
    q1, q2, p1, p2 = z.T
    L, G = (q1**2 + p1**2) / 2, (q2**2 + p2**2) / 2
    l, w = np.arctan2(-p1, q1), np.arctan2(p2, q2)
    a, e = L**2, np.sqrt(1 - (1 - G / L) ** 2)
    M = l - w
    E = M + e * np.sin(M)
    for _ in range(30):
        E = E - (E - e * np.sin(E) - M) / (1 - e * np.cos(E))
    b = np.sqrt(1 - e**2)
    x, y = a * (np.cos(E) - e), a * b * np.sin(E)
    rate = 1 / (L * (1 - e * np.cos(E)))
    u, v = -np.sin(E) * rate, b * np.cos(E) * rate
    c, s = np.cos(w), np.sin(w)
    return np.stack([c * x - s * y, s * x + c * y, c * u - s * v, s * u + c * v], 1)


def variables(state):
    """Poincare's variables (N, 4) of positions and velocities."""
    x, y, u, v = state.T
    r = np.hypot(x, y)
    h = x * v - y * u
    a = 1 / (2 / r - (u**2 + v**2))
    ex, ey = v * h - x / r, -u * h - y / r
    e2 = ex**2 + ey**2
    L = np.sqrt(a)
    w = np.arctan2(ey, ex)
    # The eccentric anomaly from r and the radial velocity.
    E = np.arctan2((x * u + y * v) / L, 1 - r / a)
    l = E - (x * u + y * v) / L + w
    G = L * e2 / (1 + np.sqrt(1 - e2))
    return np.stack(
        [np.sqrt(2 * L) * np.cos(l), np.sqrt(2 * G) * np.cos(w),
         -np.sqrt(2 * L) * np.sin(l), np.sqrt(2 * G) * np.sin(w)], 1)


def three_body(z, periods=1):
    """The map of `periods` periods of the planet, (periods + 1, N, 4), the points first."""
    import rebound

    sim = rebound.Simulation()
    sim.integrator = "ias15"
    sim.add(m=1.0)
    sim.add(m=MASS, x=1.0, vy=np.sqrt(1 + MASS))
    # The coordinates are about the star: so are those that leave.
    for x, y, u, v in particles(z):
        sim.add(m=0.0, x=x, y=y, vx=u, vy=v)
    sim.N_active = 2
    out = [z]
    for k in range(1, periods + 1):
        sim.integrate(k * 2 * np.pi / np.sqrt(1 + MASS))
        star, rest = sim.particles[0], sim.particles[2:]
        state = [[p.x - star.x, p.y - star.y, p.vx - star.vx, p.vy - star.vy] for p in rest]
        out.append(variables(np.array(state)))
    return np.array(out)


def spring_pendulum(z, steps=1):
    """The map of `steps` times h, (steps + 1, N, 4), the points first."""
    from scipy.integrate import solve_ivp

    scale = np.sqrt(np.sqrt(STIFFNESS))
    rest = 1 + 1 / STIFFNESS
    n = len(z)

    def field(_, s):
        R, f, pr, pf = s.reshape(4, n)
        return np.concatenate([
            pr, pf / R**2,
            pf**2 / R**3 - STIFFNESS * (R - 1) + np.cos(f), -R * np.sin(f)])

    start = np.concatenate([rest + z[:, 0] / scale, z[:, 1], z[:, 2] * scale, z[:, 3]])
    times = SPRING_TIME * np.arange(steps + 1)
    found = solve_ivp(field, (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-15)
    R, f, pr, pf = found.y.reshape(4, n, steps + 1)
    out = np.stack([(R - rest) * scale, f, pr / scale, pf], -1)
    return out.transpose(1, 0, 2)


def three_body_points(count, seed):
    random = np.random.default_rng(seed)
    L = np.sqrt(random.uniform(0.379, 0.381, count))
    e = 0.1 * np.sqrt(random.uniform(0, 1, count))
    G = L * e**2 / (1 + np.sqrt(1 - e**2))
    l, w = random.uniform(-np.pi, np.pi, (2, count))
    return np.stack(
        [np.sqrt(2 * L) * np.cos(l), np.sqrt(2 * G) * np.cos(w),
         -np.sqrt(2 * L) * np.sin(l), np.sqrt(2 * G) * np.sin(w)], 1)


def spring_pendulum_points(count, seed):
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (count, 4)) * [0.1, 0.8, 0.1, 0.8]


def main(folder):
    for name, map_of, points in [
        ("three-body", three_body, three_body_points),
        ("spring-pendulum", spring_pendulum, spring_pendulum_points),
    ]:
        z = points(1000, 1)
        np.savez_compressed(folder / f"{name}.npz", input=z, output=map_of(z)[1])
        z = points(300, 2)
        np.savez_compressed(folder / f"{name}-check.npz", input=z, output=map_of(z)[1])
        np.save(folder / f"{name}-orbits.npy", map_of(points(8, 3), 1000)[::10])


if __name__ == "__main__":
    here = pathlib.Path(__file__).parent
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here)
