"""The workloads of `workloads.rs` in JAX, from the same files, in their best variants.

Used by `compare.py`; run that.
"""

import functools
import json
import pathlib

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)


def kick(layer, y, eta):
    """grad V at y - eta, rows of y being points."""
    w_in, b_in, w_out = layer
    t = jnp.tanh(y @ w_in + b_in)
    return ((1 - t * t) * w_out) @ w_in.T


def henon(layer, x, y, eps):
    w_in, b_in, w_out, eta = layer
    g = lambda v: eps * kick((w_in, b_in, w_out), v, eta)
    a = x - g(y)
    b = y - g(-a)
    x = a + g(-b - eta)
    y = b + g(x - eta)
    return x, y


def henon_inverse(layer, x, y, eps):
    w_in, b_in, w_out, eta = layer
    g = lambda v: eps * kick((w_in, b_in, w_out), v, eta)
    b = y - g(x - eta)
    a = x - g(-b - eta)
    y = b + g(-a)
    x = a + g(y)
    return x, y


def gyroceptron(parameters, z, action, eps):
    """Rows of z are points."""
    psi, near, theta = parameters
    n = len(action)
    x, y = z[:, :n], z[:, n:]
    for layer in reversed(psi):
        x, y = henon_inverse(layer, x, y, 1.0)
    c, s = jnp.cos(jnp.asarray(action) * theta), jnp.sin(jnp.asarray(action) * theta)
    x, y = c * x + s * y, c * y - s * x
    for layer in psi:
        x, y = henon(layer, x, y, 1.0)
    for layer in near:
        x, y = henon(layer, x, y, eps)
    return jnp.concatenate([x, y], axis=1)


def unpack(flat, meta):
    n, at = len(meta["circle_action"]), 0
    stacks = []
    for widths in (meta["psi"], meta["near_identity"]):
        layers = []
        for h in widths:
            w_in = flat[at : at + n * h].reshape(n, h)
            b_in = flat[at + n * h : at + n * h + h]
            w_out = flat[at + n * h + h : at + n * h + 2 * h]
            eta = flat[at + n * h + 2 * h : at + n * h + 2 * h + n]
            layers.append((w_in, b_in, w_out, eta))
            at += n * h + 2 * h + n
        stacks.append(layers)
    return stacks[0], stacks[1], flat[at]


class Workload:
    """What the other side wrote: parameters and points."""

    def __init__(self, folder, name, dtype):
        folder = pathlib.Path(folder) / name
        self.meta = json.loads((folder / "meta.json").read_text())
        dim = 2 * len(self.meta["circle_action"])
        read = lambda part: np.fromfile(folder / f"{part}.f64").astype(dtype)
        self.parameters = jnp.asarray(read("parameters"))
        self.input = jnp.asarray(read("input").reshape(-1, dim))
        self.expected = np.fromfile(folder / "result.f64")
        if (folder / "output.f64").exists():
            self.output = jnp.asarray(read("output").reshape(-1, dim))
        self.action, self.eps = self.meta["circle_action"], self.meta["epsilon"]

    def map(self, flat, z):
        return gyroceptron(unpack(flat, self.meta), z, self.action, self.eps)


def loss_variants(w):
    """Loss and gradient: whole, in chunks, and on two host devices."""

    def loss(flat, z, target):
        residual = w.map(flat, z) - target
        return jnp.mean(residual * residual)

    yield "whole", lambda: jax.jit(jax.value_and_grad(loss)), (w.parameters, w.input, w.output)

    for size in (500, 2000):
        def chunked(flat, z, target, size=size):
            parts = (z.reshape(-1, size, z.shape[1]), target.reshape(-1, size, z.shape[1]))

            def body(total, part):
                value, grad = jax.value_and_grad(loss)(flat, *part)
                return (total[0] + value, total[1] + grad), None

            zero = (jnp.zeros((), z.dtype), jnp.zeros_like(flat))
            (value, grad), _ = jax.lax.scan(body, zero, parts)
            count = z.shape[0] // size
            return value / count, grad / count

        yield f"chunks of {size}", lambda f=chunked: jax.jit(f), (w.parameters, w.input, w.output)
        if jax.device_count() > 1:
            k = jax.device_count()
            split = lambda a: a.reshape(k, -1, a.shape[1])

            def both(flat, z, target, f=chunked):
                parts = jax.pmap(f, in_axes=(None, 0, 0))(flat, z, target)
                return parts[0].mean(), parts[1].mean(axis=0)

            yield f"{k} devices, chunks of {size}", lambda f=both: f, (
                w.parameters,
                split(w.input),
                split(w.output),
            )


def rollout_variants(w):
    steps = w.meta["steps"]

    for unroll in (1, 4):
        def run(flat, z, unroll=unroll):
            def body(c, _):
                c = w.map(flat, c)
                return c, c

            return jax.lax.scan(body, z, None, length=steps, unroll=unroll)[1]

        yield f"scan, unroll {unroll}", lambda f=run: jax.jit(f), (w.parameters, w.input)


def jacobian_variants(w):
    one = lambda flat, z: w.map(flat, z[None])[0]
    forward = jax.vmap(jax.jacfwd(one, argnums=1), in_axes=(None, 0))
    yield "jacfwd", lambda: jax.jit(forward), (w.parameters, w.input)
    reverse = jax.vmap(jax.jacrev(one, argnums=1), in_axes=(None, 0))
    yield "jacrev", lambda: jax.jit(reverse), (w.parameters, w.input)
    for size in (500,):
        def chunked(flat, z, size=size):
            parts = z.reshape(-1, size, z.shape[1])
            return jax.lax.map(lambda part: forward(flat, part), parts)

        yield f"jacfwd, chunks of {size}", lambda f=chunked: jax.jit(f), (w.parameters, w.input)
        if jax.device_count() > 1:
            k = jax.device_count()
            both = jax.pmap(chunked, in_axes=(None, 0))
            split = w.input.reshape(k, -1, w.input.shape[1])
            yield f"{k} devices, chunks of {size}", lambda f=both: f, (w.parameters, split)


VARIANTS = {"loss": loss_variants, "rollout": rollout_variants, "jacobians": jacobian_variants}


def agrees(w, result):
    """The same work: the result is that of the other side, up to rounding."""
    kind = w.meta["kind"]
    if kind == "loss":
        ours = np.concatenate([np.asarray(result[0]).reshape(1), np.asarray(result[1])])
    elif kind == "rollout":
        # Rounding grows along a trajectory: the first steps are compared.
        ours = np.asarray(result)[: w.meta["compared"]].reshape(-1)
    else:
        ours = np.asarray(result).reshape(-1)
    scale = np.abs(w.expected).max()
    return float(np.abs(ours - w.expected).max() / scale)
