#!/usr/bin/env python3
"""Proofs of invariant circles beside Arb: a check that shares no code with the crate, and no arithmetic.

    python benches/peers/arb_proof.py MODEL.json PROOF.json [--circle N]

It takes python-flint (0.9) and nothing else. Of the crate it takes two files, the weights of a model of a plane in
normal form with tanh neurons and the curves with their constants that `gyroceptron prove` wrote, and the text of the
theorem, src/guide/proofs.md, whose names and numbers are used here. Numbers are balls of Arb, of 256 bits.

What the theorem makes of the constants is recomputed to the end, and so is |E| by Lemma 4. Of the suprema over strips
this is no proof: they are sampled, on the lines where they are attained, so that a constant below one is found out. Two
that are not in the file, inf |L.L| and sup |DF|, are taken from the samples. |E| of the file is to be no smaller than
what is found here, and it is larger by far where it is the rounding of its own numbers, two doubles each, that it
bounds, and not where it took three. That circles are nested is not looked at.

Status 0 when every line says ok, 1 when one does not.
"""

import argparse
import functools
import json
import struct
import sys

from flint import acb, arb, ctx

ctx.prec = 256
PI = arb.pi()
# The least number of points on each line.
SAMPLES = 2048
# The strip loses delta_0 = rho/PARTS in the first step of three.
PARTS = 7
# eta_0, and what eta_1 may be, as parts of |K'|.
ETA_0 = arb("1e-9")
ETA_1 = ["1e-5", "1e-7", "1e-9"]
# The terms of A(delta) that are summed as they are.
TERMS = 1500


class Checks:
    """One line a check; whether all of them held."""

    def __init__(self):
        self.all_hold = True

    def __call__(self, name, holds, numbers):
        self.all_hold &= bool(holds)
        print(f"  {'ok  ' if holds else 'FAIL'} {name:<38} {numbers}")


def show(x):
    """A number in five digits."""
    return f"{float(x.mid() if isinstance(x, arb) else x):.5g}"


def largest(values):
    """The largest of balls."""
    return functools.reduce(arb.max, values)


def smallest(values):
    """The smallest of balls."""
    return functools.reduce(arb.min, values)


def square(z):
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag


def norm(*z):
    """The Euclidean norm of complex numbers."""
    return sum(map(square, z)).sqrt()


def det(a, b):
    """det(a, b) of two vectors."""
    return a[0] * b[1] - a[1] * b[0]


# --- The rotation number ---


def quotients(text):
    """a_1 ... a_r of `[0; a_1, ..., a_r, (1)]`."""
    first, rest = text.strip("[] ").split(";")
    *own, period = (part.strip() for part in rest.split(","))
    if first.strip() != "0" or period != "(1)":
        raise ValueError(f"rotation number {text}: not of the form [0; a, b, (1)]")
    return [int(a) for a in own]


def rotation_number(text):
    """omega, the end of ones being 1/(golden mean), and gamma: the infimum of k|k omega - m|."""
    own = quotients(text)
    omega = (arb(5).sqrt() - 1) / 2
    for a in reversed(own):
        omega = 1 / (a + omega)
    # The convergents p/q: beyond two of the end of ones q|q omega - p| stays between those two.
    gamma, (p_0, q_0), (p, q) = omega, (1, 0), (0, 1)
    for a in own + [1, 1, 1]:
        (p_0, q_0), (p, q) = (p, q), (a * p + p_0, a * q + q_0)
        gamma = gamma.min(q * abs(q * omega - p))
    return omega, gamma


# --- The map ---


class Neurons:
    """f(x) = sum of a w sech^2(a x + b) and its first two derivatives, of [a's, b's, w's]."""

    def __init__(self, numbers):
        h = len(numbers) // 3
        a, b, w = ([arb(x) for x in numbers[i * h : (i + 1) * h]] for i in range(3))
        self.rows = [(a, b, a * w, a * a * w, a * a * a * w) for a, b, w in zip(a, b, w)]
        # How far an argument of tanh was from its poles' slits Re = 0, |Im| >= pi/2, at least.
        self.off_slits = arb("inf")

    def __call__(self, x, order):
        f, f_1, f_2 = acb(0), acb(0), acb(0)
        for a, b, aw, aaw, aaaw in self.rows:
            u = a * x + b
            self.off_slits = self.off_slits.min(abs(u.real).max(PI / 2 - abs(u.imag)))
            t = u.tanh()
            s = 1 - t * t
            f += aw * s
            if order:
                f_1 -= 2 * aaw * t * s
                f_2 += aaaw * s * (6 * t * t - 2)
        return f, f_1, f_2


class PlaneMap:
    """F = K_eps o Phi_theta o T in the coordinates of the normal form."""

    def __init__(self, model):
        of, self.rest = model["architecture"], list(model["parameters"])
        if of["dof"] != 1 or len(of["circles"]) != 1 or not of["circles"][0][0]:
            raise ValueError("the model is to have one degree of freedom and one circle")
        if of.get("reversor") or of.get("controls"):
            raise ValueError("reversible models and those with controls are not supported")
        factor = {"none": 1.0, "epsilon": of["epsilon"], "time": of["flow_time"]}
        # The double that the program forms.
        factor["epsilon-time"] = of["epsilon"] * of["flow_time"]
        self.m, self.shears, self.kicks, self.tanh = of["circles"][0][0], [], [], []
        for block in of["blocks"]:
            layer, part, scale = block["layer"], block["part"], arb(factor[block["scale"]])
            if set(block) - {"name", "part", "scale", "layer", "widths"}:
                raise ValueError(f"block {block['name']}: neurons of tanh only")
            for number, h in enumerate(block["widths"]):
                if part in ("conjugation", "chart"):
                    # The coordinates of the data: not of this map.
                    self.take({"henon": 3 * h + 1, "turned-kick": 3 * h + 1}[layer])
                elif (part, layer) == ("slow-map", "twist"):
                    neurons = self.neurons(h)
                    # The first, the third and so on have a quadratic form.
                    linear = self.take(1)[0] if number % 2 == 0 else 0.0
                    self.shears.append((scale, neurons, arb(linear)))
                elif (part, layer) == ("perturbation", "turned-kick"):
                    angle = arb(self.take(1)[0])
                    self.kicks.append((scale, angle.cos(), angle.sin(), self.neurons(h)))
                else:
                    raise ValueError(f"block {block['name']}: {layer} as {part} is not supported")
        self.theta = arb(self.take(1)[0])
        if self.rest:
            raise ValueError(f"{len(self.rest)} parameters too many")

    def take(self, count):
        """The next parameters."""
        if len(self.rest) < count:
            raise ValueError("too few parameters")
        out, self.rest = self.rest[:count], self.rest[count:]
        return out

    def neurons(self, h):
        """The next h neurons."""
        self.tanh.append(Neurons(self.take(3 * h)))
        return self.tanh[-1]

    def off_slits(self):
        """How far arguments of tanh were from the slits at least since the last call."""
        out = smallest(neurons.off_slits for neurons in self.tanh)
        for neurons in self.tanh:
            neurons.off_slits = arb("inf")
        return out

    def angle(self, x, order):
        """The clockwise angle m(theta + c G'(x)) at the action x, and its derivatives in x."""
        g, g_1, g_2 = acb(self.theta), acb(0), acb(0)
        for scale, neurons, linear in self.shears:
            f, f_1, f_2 = neurons(x, order)
            g, g_1, g_2 = g + scale * (f + linear * x), g_1 + scale * (f_1 + linear), g_2 + scale * f_2
        return self.m * g, self.m * g_1, self.m * g_2

    def __call__(self, z, order=0):
        """F(z); with order 2 also its derivatives [F_1, F_2] and [F_11, F_12, F_22]."""
        (q, p), m = z, self.m
        g, g_1, g_2 = self.angle(m * (q * q + p * p) / 2, order)
        c, s = g.cos(), g.sin()
        q, p = c * q + s * p, c * p - s * q
        first, second = [], []
        if order:
            # z' = R(g) z, dR/dg z = (p', -q'), d^2R/dg^2 z = -z'.
            columns, turned = [(c, -s), (s, c)], [(-s, -c), (c, -s)]
            d = [g_1 * m * x for x in z]
            first = [[r[0] + p * d[j], r[1] - q * d[j]] for j, r in enumerate(columns)]
            for j, k in [(0, 0), (0, 1), (1, 1)]:
                d_jk = g_2 * m * m * z[j] * z[k] + (g_1 * m if j == k else 0)
                mixed = [turned[j][i] * d[k] + turned[k][i] * d[j] for i in (0, 1)]
                more = d[j] * d[k]
                second.append([mixed[0] - q * more + p * d_jk, mixed[1] - p * more - q * d_jk])
        for scale, c, s, neurons in self.kicks:
            # R(-phi), the kick, R(phi): z + f(e z) n, e = (cos, sin), n = (-sin, cos).
            f, f_1, f_2 = (scale * value for value in neurons(c * q + s * p, order))
            q, p = q - s * f, p + c * f
            if order:
                u = [c * a + s * b for a, b in first]
                along = [f_2 * u[j] * u[k] for j, k in [(0, 0), (0, 1), (1, 1)]]
                along = [uu + f_1 * (c * a + s * b) for uu, (a, b) in zip(along, second)]
                first = [[a - s * f_1 * x, b + c * f_1 * x] for (a, b), x in zip(first, u)]
                second = [[a - s * x, b + c * x] for (a, b), x in zip(second, along)]
        return (q, p), first, second


# --- The curve ---


def mode(digits):
    """c_k, the two numbers of 128 hexadecimal digits."""
    if len(digits) != 128:
        raise ValueError("a mode is to have 128 digits")
    d = [arb(x) for x in struct.unpack(">8d", bytes.fromhex(digits))]
    return acb(d[0] + d[1], d[2] + d[3]), acb(d[4] + d[5], d[6] + d[7])


def conjugate(z):
    """The conjugate number."""
    return acb(z.real, -z.imag)


class Curve:
    """K(phi) = sum of c_k e^{2 pi i k phi}, c_{-k} = conj c_k."""

    def __init__(self, modes, omega):
        self.modes, self.omega = [mode(digits) for digits in modes], omega

    def values(self, count, height=0, derivative=False, ahead=False):
        """K, K' or K(. + omega) at `count` points of the line Im phi = height, by a Fourier transform."""
        if count < 2 * len(self.modes):
            raise ValueError("fewer points than modes")
        out = []
        for i in (0, 1):
            sums = [acb(0)] * count
            for k, c in enumerate(self.modes):
                for k, c in {k: c[i], -k: conjugate(c[i]) if k else c[i]}.items():
                    if derivative:
                        c *= acb(0, 2 * PI * k)
                    if ahead:
                        c *= (2 * k * self.omega * acb(0, 1) * PI).exp()
                    # The transform has e^{-2 pi i jk/n}.
                    sums[-k % count] = c * (-2 * PI * k * height).exp()
            out.append(acb.dft(sums))
        return list(zip(*out))


def turns(z):
    """How often closed values go around 0, and the largest angle between two of them."""
    angles = [(b / a).arg() for a, b in zip(z, z[1:] + z[:1])]
    return sum(angles) / (2 * PI), largest(map(abs, angles))


# --- The checks ---


def check_rotation(check, text, omega, gamma, circle):
    """gamma by continued fractions, and by trying each k."""
    stated = arb(circle["constants"]["gamma"])
    check("omega", abs(omega - arb(circle["value"])) < 1e-15, f"{show(omega)} = {text}")
    products = []
    for k in range(1, 10001):
        x = k * omega
        m = int((x + 0.5).floor().unique_fmpz())
        products.append(k * abs(x - m))
    least = smallest(products)
    holds = stated <= gamma + arb("1e-15") and least >= gamma - arb("1e-60") and least >= stated - arb("1e-15")
    # The file has the nearest double, or the one below.
    check("gamma <= k|k omega - m|, k <= 10000", holds, f"{show(stated)}, infimum {show(gamma)}, tried {show(least)}")


def lemma_4(circle, curve, images):
    """|E| on |Im phi| <= rho from F o K at points: the bound, and its part that is aliasing and the cut."""
    n, big, rho, hat = len(images), *(arb(x) for x in (circle["constants"]["image"], circle["rho"], circle["rho_hat"]))
    modes = curve.modes
    spectra = [acb.dft([z[i] for z in images]) for i in (0, 1)]

    def decay(k, by):
        return (-2 * PI * k * by).exp()

    best, main, aliased = None, arb(0), arb(0)
    for k in range((n + 1) // 2):
        e = [spectrum[k] / n for spectrum in spectra]
        if k < len(modes):
            phase = acb(0, 2 * PI * k * curve.omega).exp()
            e = [f - c * phase for f, c in zip(e, modes[k])]
        weight = (2 if k else 1) / decay(k, rho)
        main += norm(*e) * weight
        aliased += big * (decay(n - k, hat) + decay(n + k, hat)) / (1 - decay(n, hat)) * weight
        cut = 2 * big * decay(k + 1, hat - rho) / (1 - decay(1, hat - rho))
        if k + 1 >= len(modes) and (best is None or main + aliased + cut < best[0]):
            best = main + aliased + cut, aliased + cut, k
    return best


def sampled(plane_map, curve, count, height):
    """What the constants bound, at points of a line: lists of numbers by name."""
    points, tangents = curve.values(count, height), curve.values(count, height, derivative=True)
    ahead = curve.values(count, height, derivative=True, ahead=True)
    out = {name: [] for name in ["tangent", "normal", "moved_normal", "torsion", "second", "first", "T", "LL", "F"]}
    for z, l, l_ahead in zip(points, tangents, ahead):
        image, d, dd = plane_map(z, 2)
        ll, ll_ahead = (a * a + b * b for a, b in (l, l_ahead))
        n, n_ahead = (-l[1] / ll, l[0] / ll), (-l_ahead[1] / ll_ahead, l_ahead[0] / ll_ahead)
        moved = [d[0][i] * n[0] + d[1][i] * n[1] for i in (0, 1)]
        torsion = det(moved, n_ahead)
        of = {"tangent": norm(*l), "normal": norm(*n), "moved_normal": norm(*moved), "torsion": abs(torsion)}
        of |= {"first": norm(*d[0], *d[1]), "second": norm(*dd[0], *dd[1], *dd[1], *dd[2])}
        for name, value in (of | {"T": torsion, "LL": ll, "F": image}).items():
            out[name].append(value)
    return out


def small_divisors(delta, omega, gamma):
    """A(delta) of Lemma 3, by its sum; and its bound that is used for all further steps."""
    x = (-4 * PI * delta).exp()
    total = sum(x**k / (2 * (PI * k * omega).sin()) ** 2 for k in range(1, TERMS + 1))
    # By parts, n = TERMS + 1: sum of (x^k - x^{k+1}) k^2 = n^2 x^n + sum over k > n of (2k - 1)x^k.
    n = TERMS + 1
    rest = n * n * x**n + x ** (n + 1) * ((2 * n + 1) / (1 - x) + 2 * x / (1 - x) ** 2)
    total += PI**2 / (3 * gamma**2) * rest / 16
    bound = 1 / (arb(96).sqrt() * gamma * delta)
    return (2 * total.sqrt()).min(bound), bound


def with_neighbours(of, square_below, first_above, eta_0, eta_1):
    """The bounds for all curves within eta_0 and eta_1 of K, from those of K; None unless (4) and (5) hold."""
    l, b = of["tangent"], of["moved_normal"]
    less = 2 * l * eta_1 + eta_1**2
    l_all, m_all = l + eta_1, square_below - less
    n_all, nu = l_all / m_all, eta_1 / m_all + l * less / (square_below * m_all)
    beta = of["second"] * eta_0 * n_all + first_above * nu
    tau = beta * n_all + b * nu
    mean = of["mean_torsion"] - tau
    if not (m_all > 0 and mean > 0):
        return None
    return {"l": l_all, "n": n_all, "b": b + beta, "t": of["torsion"] + tau, "sigma": 1 / mean, "c_2": of["second"]}


def step_bounds(a, delta, of):
    """kappa and C_Delta of a step with this A, from the bounds."""
    l, n, b, t, sigma, c_2 = (of[name] for name in ["l", "n", "b", "t", "sigma", "c_2"])
    x_n = sigma * n + (1 + sigma * t) * a * l
    x_l = a * (n + t * x_n)
    c_delta = l * x_l + n * x_n
    return (n / 2 + x_l + n * b * x_n) / delta + c_2 * c_delta**2 / 2, c_delta


def close(of, e, divisors):
    """The recursion: the first kappa, the margin, the steps before, and the sums of C e and C e/delta; or None."""
    moved, moved_tangent, first = arb(0), arb(0), None
    for step in range(20):
        delta, a, bound = divisors(step)
        kappa, c_delta = step_bounds(a, delta, of)
        first = kappa if first is None else first
        larger, c_larger = step_bounds(bound, delta, of)
        margin = 16 * larger * e
        if margin < 0.01:
            last = arb("1.01") * c_larger * e
            return first, margin, step, moved + last, moved_tangent + last / delta
        if not kappa * e < 1:
            return None
        moved, moved_tangent = moved + c_delta * e, moved_tangent + c_delta * e / delta
        e = kappa * e * e
    return None


def check_circle(check, plane_map, circle):
    """All checks of a circle."""
    text, n = circle["rotation_number"], circle["points"]
    of = {name: arb(value) for name, value in circle["constants"].items()}
    rho, hat = arb(circle["rho"]), arb(circle["rho_hat"])
    omega, gamma = rotation_number(text)
    curve = Curve(circle["modes"], omega)
    count = n * -(-SAMPLES // n)
    check("0 < rho < rho_hat", 0 < rho < hat, f"{show(rho)}, {show(hat)}; {len(curve.modes)} modes, {n} points")
    check_rotation(check, text, omega, gamma, circle)
    gamma = gamma.min(of["gamma"])

    # (1) on the outer edge.
    plane_map.off_slits()
    centre = curve.modes[0]
    images = [plane_map(z)[0] for z in curve.values(count, hat)]
    off_slits = plane_map.off_slits()
    check("(1) arguments of tanh off the slits", off_slits > 0, show(off_slits))
    image = largest(norm(*(a - b for a, b in zip(z, centre))) for z in images)
    compare(check, "(1) image", image, of["image"])

    # The inner edge and the real line.
    edge, real = sampled(plane_map, curve, count, rho), sampled(plane_map, curve, count, 0)

    # (2) on the real line.
    residual, aliasing, cut = lemma_4(circle, curve, real["F"][:: count // n])
    numbers = f"{show(residual)} of {show(of['residual'])}; aliasing {show(aliasing)} of {show(of['aliasing'])}"
    check("(2) residual", residual <= of["residual"], f"{numbers}; cut at {cut}")

    # (3) to (5).
    for name in ["tangent", "normal", "moved_normal", "torsion", "second"]:
        compare(check, f"(3) {name}, Im phi = rho", largest(edge[name]), of[name])
        here = largest(real[name])
        check(f"(3) {name}, Im phi = 0", here <= of[name], f"{show(here)} of {show(of[name])}")
    around, jump = turns(edge["LL"])
    check("(3) L.L does not go around 0", abs(around) < 0.5 and jump < 1, f"{show(around)}, angles up to {show(jump)}")
    mean = sum(real["T"][:: count // n]).real / n
    off = 2 * of["torsion"] / ((2 * PI * n * rho).exp() - 1)
    compare(check, "(5) mean of T", of["mean_torsion"], abs(mean) - off)

    # (4) to (8), by the first eta_1 that does.
    @functools.cache
    def divisors(step):
        delta = rho / PARTS / 2**step
        return delta, *small_divisors(delta, omega, gamma)

    square_below, first_above = smallest(map(abs, edge["LL"])), largest(edge["first"])
    # A bound of |K'|, by the moduli of its modes.
    size = 4 * PI * sum(k * norm(*mode) for k, mode in enumerate(curve.modes))
    eta_0 = ETA_0 * size
    for part in ETA_1:
        eta_1 = arb(part) * size
        nearby = with_neighbours(of, square_below, first_above, eta_0, eta_1)
        closed = nearby and close(nearby, of["residual"], divisors)
        if closed and closed[3] <= eta_0 and closed[4] <= eta_1:
            break
    else:
        check("(4) to (8)", False, "with no eta_1")
        return
    kappa, margin, steps, moved, moved_tangent = closed
    l_l = f"|L.L| >= {show(square_below)}, |DF| <= {show(first_above)}"
    check("(4), (5) hold nearby", True, f"eta_1 = {part}|K'|, {l_l}, n {show(nearby['n'])}")
    agree(check, "(6) kappa", kappa, of["kappa"])
    # Each step squares it.
    agree(check, "(6) 16 kappa e < 0.01", margin, of["margin"], 0.01 * 2**steps)
    check("(6) steps before", steps == of["steps"], steps)
    agree(check, "(7) distance <= eta_0", moved, of["distance"])
    check("(8) moved tangent <= eta_1", moved_tangent <= eta_1, f"{show(moved_tangent)} of {show(eta_1)}")

    # (9) and (10).
    around = [acb(x.real - centre[0].real, y.real - centre[1].real) for x, y in curve.values(count)]
    near = smallest(map(abs, around))
    number, jump = turns(around)
    holds = near > moved and abs(abs(number) - 1) < 0.5 and jump < 1
    check("(9), (10) around its centre once", holds, f"{show(number)} turns, distance {show(near)}")


def compare(check, name, found, bound):
    """found <= bound, and not less than nine tenths of it."""
    check(name, found <= bound and found >= bound * arb("0.9"), f"{show(found)} of {show(bound)}")


def agree(check, name, found, stated, tolerance=0.01):
    """The same to a percent, or what is given."""
    ratio = found / stated
    check(name, abs(ratio - 1) < tolerance, f"{show(found)} against {show(stated)}, ratio {show(ratio)}")


def main():
    """Checks the circles of a proof."""
    parser = argparse.ArgumentParser(description="Check proofs of invariant circles with balls of Arb.")
    parser.add_argument("model")
    parser.add_argument("proof")
    parser.add_argument("--circle", type=int, help="the number of one circle, from 0")
    options = parser.parse_args()
    with open(options.model, encoding="utf-8") as file:
        model = json.load(file)
    with open(options.proof, encoding="utf-8") as file:
        proof = json.load(file)
    plane_map, check = PlaneMap(model), Checks()
    check("digest of the model", model["digest"] == proof["model"], model["digest"][:16])
    numbers = range(len(proof["circles"])) if options.circle is None else [options.circle]
    for number in numbers:
        circle = proof["circles"][number]
        print(f"circle {number}, {circle['rotation_number']}")
        check_circle(check, plane_map, circle)
    sys.exit(0 if check.all_hold else 1)


if __name__ == "__main__":
    main()
