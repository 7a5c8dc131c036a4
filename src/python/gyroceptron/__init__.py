"""Symplectic gyroceptrons: nearly-periodic symplectic maps that are trained on pairs.

Points are rows of 2n numbers, q1 ... qn, p1 ... pn. All numbers are float64; results
have the bits that the program ``gyroceptron`` gives.
"""

from ._native import (
    Certificate,
    Error,
    FieldLines,
    InvariantCircle,
    Model,
    __version__,
    check_proof,
    load,
    prove,
    rotation_number,
    train,
    tunes,
)

__all__ = [
    "Certificate",
    "Error",
    "FieldLines",
    "InvariantCircle",
    "Model",
    "__version__",
    "check_proof",
    "load",
    "prove",
    "rotation_number",
    "train",
    "tunes",
]
