"""The installed wheel, as its users call it."""

import ast
import inspect
import json
import pathlib
import pickle
import threading
import time
import warnings

import numpy as np
import pytest

import gyroceptron
from conftest import flow


def test_a_network_is_trained_and_rolled_out(pairs, model):
    assert (model.kind, model.dof, model.epsilon) == ("gyroceptron", 2, 0.05)
    states = model.predict(pairs[0][:5], steps=20, every=5, outside="ignore")
    assert states.shape == (5, 5, 4) and states.dtype == np.float64
    assert np.array_equal(states[0], pairs[0][:5])
    reference = flow(pairs[0][:5], 0.05, 20 * 0.7, 4000)
    assert np.abs(states[-1] - reference).max() < 0.1
    step = model.predict(pairs[0])[1]
    assert np.mean((step - pairs[1]) ** 2) < 1e-6
    assert model.validation < 1e-6
    # What SciPy would call: lists, single precision, other strides.
    for points in (pairs[0][:3].tolist(), np.asfortranarray(pairs[0][:3]), pairs[0][::-1][-3:][::-1]):
        assert np.array_equal(model.predict(points)[1], step[:3])


def test_the_inverse_undoes_a_step(pairs, model):
    back = model.inverse(model.predict(pairs[0])[1])
    assert np.abs(back - pairs[0]).max() < 1e-12


def test_jacobians_are_symplectic_and_derivatives(pairs, model):
    points = pairs[0][:50]
    jacobian = model.jacobian(points)
    assert jacobian.shape == (50, 4, 4)
    omega = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    assert np.abs(jacobian.transpose(0, 2, 1) @ omega @ jacobian - omega).max() < 1e-13
    for k in range(4):
        h = 1e-5 * np.eye(4)[k]
        slope = (model.predict(points + h)[1] - model.predict(points - h)[1]) / 2e-5
        assert np.abs(slope - jacobian[:, :, k]).max() < 1e-8


def test_the_invariant_of_a_normal_form_stays(pairs):
    shape = {"kicks": (4, 4), "twists": (4, (2, 4))}
    model = gyroceptron.train(
        *pairs, [[1, 0]], recipe="paper", architecture="normal-form", epsilon=0.05, iterations=20, **shape
    )
    assert model.kind == "normal-form"
    states = model.predict(pairs[0][:3], steps=10_000, every=1000, outside="ignore")
    along = model.invariant(states.reshape(-1, 4)).reshape(11, 3)
    assert np.abs(along / along[0] - 1).max() < 1e-12
    assert along[0].min() > 0


def test_couplings_are_invertible_and_not_symplectic(pairs):
    q, p = np.hsplit(pairs[1], 2)
    damped = np.hstack([q, 0.8 * p])
    model = gyroceptron.train(
        pairs[0], damped, [1, 0], architecture="coupling-gyroceptron", epsilon=0.05, flow_time=1.0,
        theta=0.5, psi=(1, 3), near_identity=(4, 4), iterations=20,
    )
    assert model.kind == "coupling-gyroceptron"
    z = pairs[0][:5]
    assert np.abs(model.inverse(model.predict(z)[1]) - z).max() < 1e-12
    assert np.abs(np.linalg.det(model.jacobian(z)) - 1).max() > 1e-2
    certificate = model.verify(samples=20)
    assert certificate.holds and "not claimed" in str(certificate)
    with pytest.raises(gyroceptron.Error, match="symplectic"):
        model.invariant(z)
    with pytest.raises(gyroceptron.Error, match="epsilon"):
        gyroceptron.train(
            *pairs, [1, 0], recipe="paper", architecture="coupling-gyroceptron", epsilon=0.0, iterations=1
        )


def test_the_structure_is_certified(model):
    certificate = model.verify(samples=20)
    assert certificate.holds and certificate.summary.startswith("holds: ")
    assert {"law", "largest", "limit", "verdict"} <= set(certificate.rows[0])
    assert "symplecticity" in str(certificate) and repr(certificate).startswith("<Certificate")


def test_files_and_the_program_give_the_same_bits(tmp_path, pairs, model, program):
    path = tmp_path / "model.json"
    model.save(path)
    again = gyroceptron.load(path)
    assert np.array_equal(again.parameters, model.parameters) and again.region == model.region
    with pytest.raises(gyroceptron.Error, match="model.json"):
        model.save(path)
    model.save(path, overwrite=True)

    points = pairs[0][:7] * 0.5
    np.save(tmp_path / "z.npy", points)
    np.savez(tmp_path / "pairs.npz", input=pairs[0], output=pairs[1])
    program("predict", "--model", path, "--input", tmp_path / "z.npy", "--steps", 100,
            "--every", 10, "--output", tmp_path / "t.npy", "--invariant", tmp_path / "mu.npy")
    states = np.load(tmp_path / "t.npy")
    assert np.array_equal(states, model.predict(points, 100, 10))
    along = np.load(tmp_path / "mu.npy")
    assert np.array_equal(along.ravel(), model.invariant(states.reshape(-1, 4)))
    program("train", "--data", tmp_path / "pairs.npz", "--circle-action", "1,0", "--epsilon", 0.05,
            "--recipe", "paper", "--optimiser", "lm", "--iterations", 60, "--seed", 4, "--output", tmp_path / "own.json")
    assert (tmp_path / "own.json").read_bytes() == path.read_bytes()


def test_units_of_the_data_are_undone(pairs, model):
    large = gyroceptron.train(
        128 * pairs[0], 128 * pairs[1], [1, 0], recipe="paper", epsilon=0.05, optimiser="lm", iterations=60, seed=4
    )
    plain = gyroceptron.train(
        *pairs, [1, 0], recipe="paper", epsilon=0.05, optimiser="lm", iterations=60, seed=4, units="data"
    )
    factors = np.array(large.units[1])
    assert model.units == plain.units and (factors >= 32).all()
    points = 128 * pairs[0][:9]
    step = large.predict(points)[1]
    assert np.abs(step - 128 * pairs[1][:9]).max() < 128 * 0.01
    slope = large.jacobian(points)
    omega = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    assert np.abs(slope.transpose(0, 2, 1) @ omega @ slope - omega).max() < 1e-12
    assert np.abs(large.inverse(step) - points).max() < 1e-10
    action = 0.5 * (points[:, 0] ** 2 + points[:, 2] ** 2)
    assert 0.2 < np.median(large.invariant(points) / action) < 5


def test_planes_are_weighed(pairs):
    def parameters(**more):
        options = {"recipe": "paper", "iterations": 2, **more}
        return gyroceptron.train(*pairs, [1, 0], **options).parameters

    auto, none = parameters(loss_weights="auto"), parameters(loss_weights="none")
    assert np.array_equal(none, parameters()) and not np.array_equal(auto, none)
    short = {"recipe": "recommended", "starts": 1, "kicks": (2, 2), "twists": (2, (2, 2))}
    recommended = [parameters(**short, loss_weights=weights) for weights in (None, "auto", "none")]
    assert np.array_equal(*recommended[:2]) and not np.array_equal(*recommended[1:])
    assert np.array_equal(parameters(loss_weights=[1, 3]), parameters(loss_weights=[2, 6, 2, 6]))
    assert np.array_equal(none, parameters(loss_weights=[5, 5]))
    for bad in ("all", [1, 2, 3], [1, 0], [1, float("nan")]):
        with pytest.raises(gyroceptron.Error, match="loss.weight"):
            parameters(loss_weights=bad)


def test_a_callback_follows_stops_and_raises(tmp_path, pairs):
    said = []
    report = tmp_path / "report"
    model = gyroceptron.train(
        *pairs, [1, 0], recipe="paper", iterations=30, seed=1, report=report,
        callback=lambda stage, iteration, loss, held_out: said.append((stage, iteration, loss, held_out)),
    )
    iterations = [iteration for _, iteration, _, _ in said]
    assert iterations == sorted(set(iterations)) and iterations[-1] == 30
    assert said[-1][0] == "training" and said[-1][3] is not None
    assert said[-1][2] < said[0][2]
    assert "Whether to trust it" in (report / "report.md").read_text()
    data = json.loads((report / "report.json").read_text())
    assert data["studies"]["training"]["models"][0]["parameters"] == len(model.parameters)
    (tmp_path / "file").write_text("mine")
    for taken in (report, tmp_path / "file"):
        calls = []
        with pytest.raises(gyroceptron.Error, match=taken.name):
            gyroceptron.train(
                *pairs, [1, 0], recipe="paper", iterations=1, report=taken, callback=lambda *said: calls.append(said)
            )
        assert not calls

    for nothing in (None, 0, "", np.float64(0)):
        goes_on = gyroceptron.train(
            *pairs, [1, 0], recipe="paper", iterations=3, callback=lambda *said, nothing=nothing: nothing
        )
        assert goes_on.history[-1]["iteration"] == 3, nothing
    stopped = gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=1000, callback=lambda *said: np.bool_(False))
    assert stopped.history[-1]["iteration"] <= 1
    stopped = gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=1000, callback=lambda *said: said[1] < 5)
    assert stopped.validation > 0 and len(stopped.parameters) == len(model.parameters)

    # Also where it says so at the end of a stage, and only once.
    said = []

    def stops_a_start(stage, iteration, *_):
        said.append((stage, iteration))
        return iteration < 40

    gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=1000, starts=3, callback=stops_a_start)
    assert [iteration for _, iteration in said] == list(range(1, 41))

    def fails(*_):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        gyroceptron.train(*pairs, [1, 0], recipe="paper", iterations=10, callback=fails)


def test_other_threads_go_on_meanwhile(pairs, model):
    count, done = [0], threading.Event()

    def counts():
        while not done.is_set():
            count[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=counts)
    thread.start()
    before, start = count[0], time.perf_counter()
    while time.perf_counter() - start < 0.3:
        model.predict(pairs[0][:400], steps=2000, every=2000, outside="ignore")
    during = count[0] - before
    done.set()
    thread.join()
    assert during > 20


def test_what_leaves_the_box_is_reported(pairs, model):
    far = np.array([[0.1, 0.1, 0.1, 9.0]])
    with pytest.warns(UserWarning, match="p2 = 9.000e0"):
        model.predict(far)
    with pytest.raises(gyroceptron.Error, match="outside the box") as said:
        model.predict(far, outside="stop")
    assert "rows 0," in str(said.value)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.predict(far, outside="ignore")
        model.predict(0.5 * pairs[0][:3])


def test_bad_input_is_named(tmp_path, pairs, model):
    def refuses(words, call, *arguments, **options):
        with pytest.raises((gyroceptron.Error, TypeError), match=words):
            call(*arguments, **options)

    refuses("columns: expected 4, found 3", model.predict, np.zeros((2, 3)))
    refuses("last dimension is 4", model.predict, 0.5)
    refuses("row 1, column 2", model.predict, [[0, 0, 0, 0], [0, 0, np.nan, 0]])
    refuses("rows", model.predict, np.zeros((0, 4)))
    refuses("steps", model.predict, np.zeros((1, 4)), steps=0)
    refuses("outside", model.predict, np.zeros((1, 4)), outside="perhaps")
    refuses("radius", model.verify, radius=float("nan"))
    refuses("none.json", gyroceptron.load, tmp_path / "none.json")
    refuses("flow_time", model.at, flow_time=3.0)
    train = gyroceptron.train
    refuses("circle_action: weights: expected 2, found 3", train, *pairs, [1, 0, 0])
    refuses("architecture", train, *pairs, [1, 0], recipe="paper", architecture="mlp")
    refuses("kicks", train, *pairs, [1, 0], recipe="paper", kicks=(2, 2))
    refuses("optimiser", train, *pairs, [1, 0], recipe="paper", optimiser="sgd")
    refuses("units", train, *pairs, [1, 0], recipe="paper", units="mine")
    refuses("validation", train, *pairs, [1, 0], recipe="paper", validation=1.5)
    refuses("rows of output", train, pairs[0], pairs[1][:5], [1, 0])
    refuses("circles", train, *pairs, [[1, 0], [0, 1]], recipe="paper")
    refuses("layers", train, *pairs, [1, 0], recipe="paper", psi=(10**12, 8))
    refuses("layers", train, *pairs, [1, 0], recipe="paper", psi=(0, 8))
    refuses("parameters", train, *pairs, [1, 0], recipe="paper", psi=(2, 2**50))
    refuses("starts", train, *pairs, [1, 0], recipe="paper", starts=0)
    refuses("starts", train, *pairs, [1, 0], recipe="paper", starts=10_001)
    refuses("recipe: .*beside a scene", train, *pairs, [1, 0], recipe="paper", scene="quickstart")
    refuses("did you mean `quickstart`", train, *pairs, [1, 0], scene="quickstar")
    refuses("none.toml", train, *pairs, [1, 0], scene=tmp_path / "none.toml")
    refuses("oscillators-long: models: .*one network", train, *pairs, [1, 0], scene="oscillators-long")
    blocks = [{"part": "none", "layer": "henon", "widths": [2]}]
    refuses("architecture: .*beside blocks", train, *pairs, [1, 0], architecture="henon-net", blocks=blocks)
    refuses("flow_time", train, *pairs, [1, 0], architecture="normal-form", flow_time=-5.0)
    refuses("flow_time", train, *pairs, [1, 0], architecture="henon-net", flow_time=5.0)
    refuses("epsilon", train, *pairs, [1, 0], recipe="paper", architecture="henon-net", epsilon=0.3)
    # Before the pairs are gone through for each harmonic.
    refuses("2000000000", train, *pairs, [1, 2_000_000_000])
    refuses("theta", train, *pairs, [1, 0], recipe="paper", architecture="henon-net", theta=0.5)
    refuses("theta_fixed", train, *pairs, [1, 0], recipe="paper", architecture="sympnet", theta_fixed=True)
    refuses("^theta_penalty: ", train, *pairs, [1, 0], recipe="paper", theta_penalty=-1.0)
    refuses("^ramp.iterations: ", train, *pairs, [1, 0], ramp=[(1.0, 0)])
    refuses("the key `flow_tim`", train, *pairs, [1, 0], ramp=[{"flow_tim": 1.0, "iterations": 1}])
    refuses("repeats of a stage .*1.5", train, *pairs, [1, 0], ramp=[{"repeats": 1.5, "iterations": 1}])
    refuses("a stage of a ramp.*iterations", train, *pairs, [1, 0], ramp=[{"flow_time": 1.0, "degree": None}])
    refuses("iterations of a stage .*-1", train, *pairs, [1, 0], ramp=[{"flow_time": 1.0, "iterations": -1}])
    # What is refused leaves nothing behind.
    gone = {"report": tmp_path / "report", "checkpoint": tmp_path / "gone", "resume": True}
    refuses("gone: cannot be read: there is none", train, *pairs, [1, 0], recipe="paper", **gone)
    assert not (tmp_path / "report").exists()
    refuses("epsilon", train, *pairs, [1, 0], recipe="paper", architecture="normal-form", epsilon=0.0)
    refuses("columns: expected 4, found 3", train, pairs[0][:, :3], pairs[1], [1, 0])
    with pytest.raises(gyroceptron.Error) as raised:
        model.predict(np.zeros((2, 3)))
    assert type(pickle.loads(pickle.dumps(raised.value))) is gyroceptron.Error
    net = train(*pairs, [1, 0], recipe="paper", architecture="henon-net", layers=(2, 3), iterations=2)
    refuses("invariant", net.invariant, pairs[0])
    assert net.kind == "henon-net" and net.angles == []


def test_stubs_say_what_there_is():
    stub = pathlib.Path(gyroceptron.__file__).with_suffix(".pyi").read_text()
    tree = ast.parse(stub)
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    names = {*(name for name in classes if not name.startswith("_")), *functions, "__version__"}
    assert names == set(gyroceptron.__all__)

    def parameters(node):
        rest = [node.args.kwarg] if node.args.kwarg else []
        return [a.arg for a in (*node.args.args, *node.args.kwonlyargs, *rest)]

    for name, node in functions.items():
        signature = inspect.signature(getattr(gyroceptron, name))
        assert parameters(node) == list(signature.parameters), name
        named = [a.arg for a in node.args.kwonlyargs]
        kinds = signature.parameters.values()
        assert named == [p.name for p in kinds if p.kind is p.KEYWORD_ONLY], name
        defaults = [ast.literal_eval(d) for d in node.args.kw_defaults]
        assert defaults == [signature.parameters[n].default for n in named], name
        assert getattr(gyroceptron, name).__doc__
    for name in ("Model", "Certificate"):
        own = {n for n in vars(getattr(gyroceptron, name)) if not n.startswith("_")}
        stubbed = {node.name: node for node in classes[name].body if isinstance(node, ast.FunctionDef)}
        public = {method for method in stubbed if not method.startswith("_")}
        assert own == public, name
        for method in public:
            assert inspect.getattr_static(getattr(gyroceptron, name), method).__doc__, method
            assert ast.get_docstring(stubbed[method]), method
        for method, node in stubbed.items():
            attribute = inspect.getattr_static(getattr(gyroceptron, name), method)
            if callable(attribute) and method in public:
                signature = inspect.signature(attribute)
                assert parameters(node) == list(signature.parameters), method
                assert attribute.__doc__, method
