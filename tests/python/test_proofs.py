"""Theorems about a model of one degree of freedom."""

import json

import numpy as np
import pytest

import gyroceptron


@pytest.fixture(scope="module")
def model():
    """A map that turns a plane at a rate that falls with the radius."""
    points = np.random.default_rng(1).uniform(-0.9, 0.9, (300, 2))
    angle = 2.3 - 0.4 * (points**2).sum(axis=1)
    cosine, sine = np.cos(angle), np.sin(angle)
    q, p = points.T
    images = np.stack([q * cosine + p * sine, p * cosine - q * sine], axis=1)
    return gyroceptron.train(points, images, [1], kicks=(2, 2), twists=(1, 3), iterations=60)


def test_circles_are_proved_and_verified_again(model, tmp_path):
    file = tmp_path / "proof.json"
    found = gyroceptron.prove(model, circles=2, end=(0.8, 0.0), output=file)
    assert found["holds"] and [c["verdict"] for c in found["circles"]] == ["proved"] * 2
    assert found["fixed_point"]["elliptic"] and len(found["statements"]) == 1
    assert all(c["constants"]["distance"] < 1e-9 for c in found["circles"])
    again = gyroceptron.check_proof(model, file)
    assert again == {"circles": 2, "statements": found["statements"]}
    with pytest.raises(gyroceptron.Error, match="overwrite=True"):
        gyroceptron.prove(model, circles=1, output=file)
    text = json.loads(file.read_text())
    text["circles"][0]["rho"] *= 0.5
    file.write_text(json.dumps(text))
    with pytest.raises(gyroceptron.Error, match="digest"):
        gyroceptron.check_proof(model, file)


def test_what_no_theorem_is_about_is_refused(model):
    for number in ["2/3", "[0; 1, 2]", "1.5"]:
        with pytest.raises(gyroceptron.Error, match="rotation number"):
            gyroceptron.prove(model, [number])
    with pytest.raises(gyroceptron.Error, match="circles"):
        gyroceptron.prove(model, circles=0)
