import torch
import torch as xp


def as_array(z):
    """Tensors of floats as they are, other numbers in double precision."""
    if isinstance(z, torch.Tensor) and z.is_floating_point():
        return z
    return torch.as_tensor(z, dtype=torch.float64)


def sech2(x):
    e = xp.exp(-2.0 * xp.abs(x))
    return 4.0 * e / (1.0 + e) ** 2


def lorentzian(x):
    return 1.0 / (1.0 + x * x)


def odd_lorentzian(x):
    return x / (1.0 + x * x)


def with_sign(x, sign):
    return xp.copysign(xp.as_tensor(x, dtype=sign.dtype), sign)


def repeat(functions, starts, z):
    """Functions one after another, for each row of places where their numbers begin in the table."""
    for row in starts:
        for (function, count), start in zip(functions, row):
            z = function(TABLE[start : start + count], z)
    return z


def times(function, count, z):
    """A function so many times."""
    for _ in range(count):
        z = function(z)
    return z


def constant_of(x):
    return x.detach()
