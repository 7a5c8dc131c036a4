"""Models as functions of other packages: the same values to rounding, and derivatives."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest

import gyroceptron


@pytest.fixture(scope="module")
def models(pairs):
    """One that is nearly periodic, one in normal form, and one of polynomials in its own units."""
    points, images = pairs
    small = {"circle_action": [1, 0], "epsilon": 0.05, "flow_time": 0.7, "starts": 1, "iterations": 8}
    paper = gyroceptron.train(points, images, recipe="paper", psi=(3, 4), near_identity=(3, 4), **small)
    normal_form = gyroceptron.train(points, images, kicks=(2, 2), twists=(2, 2), **small)
    polynomials = gyroceptron.train(30 * points, 30 * images, kicks=(2, 2, 4), twists=(2, 2, 4), **small)
    return {"gyroceptron": (paper, 1.0), "normal form": (normal_form, 1.0), "polynomials": (polynomials, 30.0)}


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    """A model of a plane (x, y) that is no canonical one."""
    x, y = np.linspace(0.5, 2.5, 12), np.linspace(-1.2, 1.2, 12)
    density = np.broadcast_to(x, (12, 12))
    # (x^2/2, y) turns about (1/2, 0) where x dx dy is the area.
    rng = np.random.default_rng(3)
    radius, angle = np.sqrt(rng.uniform(0, 0.05, 300)), rng.uniform(0, 2 * np.pi, 300)
    there = angle + 1.0 + 0.3 * radius**2
    points, images = (
        np.stack([np.sqrt(1 + 2 * radius * np.cos(a)), radius * np.sin(a)], axis=1) for a in (angle, there)
    )
    file = tmp_path_factory.mktemp("section") / "density.npz"
    np.savez(file, x=x, y=y, density=density)
    small = {"starts": 1, "iterations": 20, "kicks": (2, 2), "twists": (2, 2)}
    return gyroceptron.train(points, images, [1], section=file, **small)


def points_of(scale, dim=4):
    return scale * np.random.default_rng(5).uniform(-0.7, 0.7, (6, 2, dim))


def assert_near(found, expected, scale=1.0):
    assert np.shape(found) == np.shape(expected)
    np.testing.assert_allclose(np.asarray(found), expected, rtol=0, atol=1e-12 * scale)


def jax64():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    return jax


@pytest.mark.parametrize("kind", ["gyroceptron", "normal form", "polynomials"])
def test_jax_has_the_values_and_derivatives(models, kind):
    jax = jax64()
    model, scale = models[kind]
    function, points = model.to_jax(), points_of(scale)
    assert_near(jax.jit(function)(points), model.predict(points, 1, outside="ignore")[-1], scale)
    assert_near(function.iterate(points, 5), model.predict(points, 5, outside="ignore")[-1], scale)
    assert_near(function.iterate(points, -5), model.predict(points, -5, outside="ignore")[-1], scale)
    assert_near(function.inverse(points), model.inverse(points), scale)
    assert_near(function.invariant(points), model.invariant(points), scale**2)
    for wrong in (points[0, 0, 0], points[..., :3], np.ones((2, 6))):
        with pytest.raises(ValueError, match="expected points"):
            function(wrong)
    rows = points.reshape(-1, 4)[:3]
    for derivative in (jax.jacfwd, jax.jacrev):
        assert_near(jax.jit(jax.vmap(derivative(function)))(rows), model.jacobian(rows))


def test_torch_has_the_values_and_derivatives(models):
    torch = pytest.importorskip("torch")
    for model, scale in models.values():
        function, points = model.to_torch(), points_of(scale)
        tensor = torch.from_numpy(points).requires_grad_()
        images = function(tensor)
        assert_near(images.detach(), model.predict(points, 1, outside="ignore")[-1], scale)
        assert_near(function.iterate(tensor, -3).detach(), model.predict(points, -3, outside="ignore")[-1], scale)
        assert_near(function.invariant(tensor).detach(), model.invariant(points), scale**2)
        with pytest.raises(ValueError, match="expected points"):
            function(tensor[..., :3])
        images[..., 1].sum().backward()
        assert_near(tensor.grad, model.jacobian(points)[..., 1, :])


@pytest.mark.parametrize("name", ["jax", "torch"])
def test_sections_have_the_values_and_derivatives(section, name):
    points = np.array([[1.05, 0.02], [0.9, 0.05], [1.1, -0.1]])
    expected, jacobians = section.predict(points, 3)[-1], section.jacobian(points)
    if name == "jax":
        jax = jax64()
        function = section.to_jax()
        found, derivatives = function.iterate(points, 3), jax.vmap(jax.jacrev(function))(points)
        outside = function(np.array([0.1, 0.0]))
    else:
        torch = pytest.importorskip("torch")
        function, tensor = section.to_torch(), torch.from_numpy(points)
        found, derivatives = function.iterate(tensor, 3), torch.func.vmap(torch.func.jacrev(function))(tensor)
        outside = function(torch.tensor([0.1, 0.0], dtype=torch.float64))
    assert_near(found, expected)
    assert_near(derivatives, jacobians)
    assert np.isnan(np.asarray(outside)).all()


def test_two_models_do_not_share_their_numbers(models):
    jax64()
    first, second = (models[kind][0] for kind in ("gyroceptron", "normal form"))
    functions, points = [first.to_jax(), second.to_jax()], points_of(1.0)
    assert_near(functions[0](points), first.predict(points)[-1])
    assert_near(functions[1](points), second.predict(points)[-1])


def test_single_precision_is_said():
    pytest.importorskip("jax")
    code = (
        "import sys, warnings, numpy as np, gyroceptron\n"
        "rows = np.random.default_rng(0).uniform(-1, 1, (60, 2))\n"
        "turned = rows @ np.array([[0.6, -0.8], [0.8, 0.6]])\n"
        "model = gyroceptron.train(rows, turned, [1], starts=1, iterations=4, kicks=(1, 1), twists=(1, 1))\n"
        "with warnings.catch_warnings(record=True) as found:\n"
        "    warnings.simplefilter('always')\n"
        "    function = model.to_jax()\n"
        "assert any('single precision' in str(of.message) for of in found), found\n"
        "assert str(function(rows).dtype) == 'float32'\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_source_code_is_that_of_the_program(models, program, tmp_path):
    model, _ = models["normal form"]
    model.save(tmp_path / "m.json")
    for language, ending in (("c", "c"), ("jax", "py"), ("torch", "py")):
        path = tmp_path / f"{language}_map.{ending}"
        program("export", "--model", tmp_path / "m.json", "--format", language, "--output", path)
        code = model.source_code(language, f"{language}_map")
        assert list(code) == [f"{language}_map.{e}" for e in (["c", "h", "f90"] if language == "c" else ["py"])]
        for name, text in code.items():
            assert (tmp_path / name).read_text() == text


def test_bad_requests_say_what_is_wrong(models):
    model, _ = models["normal form"]
    with pytest.raises(gyroceptron.Error, match="c, jax, torch.*julia"):
        model.source_code("julia")
    with pytest.raises(gyroceptron.Error, match="a letter.*a-b"):
        model.source_code("c", "a-b")


def test_the_guides_example_has_the_models_derivatives():
    jax64()
    guide = pathlib.Path(__file__).parents[2] / "src/guide/source_code.md"
    example = guide.read_text().split("```python\n")[1].split("```")[0]
    names = {}
    exec(example, names)
    assert_near(names["jacobians"], names["model"].jacobian(names["points"][:5]))
