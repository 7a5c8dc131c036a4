"""What notebooks show: tables of models and certificates, portraits on axes."""

import html.parser
import re

import numpy as np
import pytest

import gyroceptron


class Sound(html.parser.HTMLParser):
    """That each element ends, and the words."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words = [], []
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data.split()


def test_models_and_certificates_are_tables(model):
    shown = Sound(model._repr_html_())
    for word in ("gyroceptron", "parameters", "681", "trust", "digest"):
        assert word in shown.words, shown.words
    certificate = model.verify(samples=30)
    table = certificate._repr_html_()
    shown = Sound(table)
    assert table.count("<tr>") == len(certificate.rows) + 1
    assert "holds:" in shown.words and "<script" not in table and "<button" not in table


def test_a_portrait_is_drawn_on_axes(model):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    points = np.array([[0.3, 0.1, 0.0, 0.2], [0.5, -0.1, 0.1, 0.0]])
    figure, (left, right) = pyplot.subplots(1, 2)
    assert model.plot_portrait(points, steps=20, plane=2, ax=left) is left
    orbits = model.predict(points, 20)
    for line, orbit in zip(left.lines, np.moveaxis(orbits, 1, 0), strict=True):
        assert (line.get_xydata() == orbit[:, [1, 3]]).all()
    assert left.get_xlabel() == "$q_{2}$" and left.get_ylabel() == "$p_{2}$"
    pyplot.sca(right)
    assert model.plot_portrait(points[0], steps=3) is right
    assert len(right.lines) == 1 and len(right.lines[0].get_xydata()) == 4
    with pytest.raises(gyroceptron.Error, match="plane"):
        model.plot_portrait(points, plane=3)
    with pytest.raises(gyroceptron.Error, match="steps"):
        model.plot_portrait(points, steps=0)
    pyplot.close(figure)


def test_lists_are_as_good_as_tuples(pairs):
    small = {"circle_action": [1, 0], "epsilon": 0.05, "flow_time": 0.7, "starts": 1, "iterations": 3}
    tuples = gyroceptron.train(*pairs, kicks=(2, 2), twists=(2, (1, 2)), **small)
    lists = gyroceptron.train(*pairs, kicks=[2, 2], twists=[2, [1, 2]], **small)
    assert tuples == lists
    with pytest.raises(TypeError, match="kicks"):
        gyroceptron.train(*pairs, kicks=[2], **small)


def test_a_progress_bar_shows_iterations_and_errors(pairs):
    import io

    pytest.importorskip("tqdm", reason="no tqdm")
    out = io.StringIO()
    with gyroceptron.ProgressBar(file=out, mininterval=0) as bar:
        gyroceptron.train(*pairs, [1, 0], kicks=(2, 2), twists=(2, 2), starts=2, iterations=60, callback=bar)
    lines = re.split(r"[\r\n]+", out.getvalue())
    named = {line.split(":")[0].strip() for line in lines if ":" in line}
    assert {"training", "start 1", "start 2"} <= named, named
    assert any(line.startswith("training: 60") and "loss=" in line and "held out=" in line for line in lines), lines
    # Of stages there is no iteration.
    bar = gyroceptron.ProgressBar(file=out)
    bar("report", None, None, None)
    bar.close()
    bar.close()
    assert "report" in out.getvalue()
