"""The regressor of the kind of scikit-learn."""

import inspect
import pickle

import numpy as np
import pytest

import gyroceptron

sklearn = pytest.importorskip("sklearn", minversion="1.6", reason="no scikit-learn")

from sklearn.base import clone  # noqa: E402
from sklearn.model_selection import GridSearchCV, cross_val_score  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import FunctionTransformer  # noqa: E402
from sklearn.utils.estimator_checks import check_estimator  # noqa: E402

from gyroceptron.sklearn import GyroceptronRegressor  # noqa: E402

SMALL = {"circle_action": [1, 0], "kicks": (2, 3), "twists": (2, 3), "starts": 1, "iterations": 20}

# Those whose data is no map of a phase space: as many outputs as inputs, an even number.
NO_MAP = {
    "check_dict_unchanged",
    "check_dont_overwrite_parameters",
    "check_dtype_object",
    "check_estimators_dtypes",
    "check_estimators_fit_returns_self",
    "check_estimators_nan_inf",
    "check_estimators_overwrite_params",
    "check_estimators_pickle",
    "check_f_contiguous_array_estimator",
    "check_fit2d_1feature",
    "check_fit2d_1sample",
    "check_fit2d_predict1d",
    "check_fit_check_is_fitted",
    "check_fit_idempotent",
    "check_fit_score_takes_y",
    "check_methods_sample_order_invariance",
    "check_methods_subset_invariance",
    "check_n_features_in",
    "check_n_features_in_after_fitting",
    "check_pipeline_consistency",
    "check_positive_only_tag_during_fit",
    "check_readonly_memmap_input",
    "check_regressor_data_not_an_array",
    "check_regressor_multioutput",
    "check_regressors_int",
    "check_regressors_no_decision_function",
    "check_regressors_train",
}


def test_its_parameters_are_those_of_train():
    own = inspect.signature(GyroceptronRegressor).parameters
    of_train = inspect.signature(gyroceptron.train).parameters
    # What is of each pair or of one call is no parameter of an estimator.
    without = {"input", "output", "controls", "control_degree", "seed"}
    without |= {"report", "checkpoint", "resume", "callback"}
    assert set(own) - {"random_state"} == set(of_train) - without
    for name in set(own) - {"random_state", "circle_action"}:
        assert own[name].default == of_train[name].default, name


@pytest.mark.filterwarnings("ignore")
def test_the_checks_of_scikit_learn():
    estimator = GyroceptronRegressor(iterations=2, starts=1, kicks=(2, 2), twists=(2, 2))
    results = check_estimator(estimator, on_fail=None, on_skip=None)
    failed = {result["check_name"] for result in results if result["status"] == "failed"}
    assert failed <= NO_MAP, failed - NO_MAP
    assert sum(result["status"] == "passed" for result in results) >= 18


def test_it_learns_what_train_learns(pairs, tmp_path):
    points, images = pairs
    regressor = GyroceptronRegressor(**SMALL, random_state=4)
    assert regressor.fit(points, images) is regressor
    model = gyroceptron.train(points, images, **SMALL, seed=4)
    assert regressor.model_ == model
    assert np.array_equal(regressor.predict(points), model.predict(points, steps=1)[1])
    assert regressor.score(points, images) > 0.99
    assert np.allclose(regressor.inverse_predict(regressor.predict(points)), points, rtol=0, atol=1e-13)
    # Whatever the layout, the container and the order; and fitted again.
    for same in (np.asfortranarray(points), points.tolist()):
        assert np.array_equal(regressor.predict(same), regressor.predict(points))
    order = np.random.default_rng(0).permutation(len(points))
    assert np.array_equal(regressor.predict(points[order]), regressor.predict(points)[order])
    assert regressor.fit(points, images).model_ == model
    again = pickle.loads(pickle.dumps(regressor))
    assert again.model_ == model and again.get_params() == regressor.get_params()
    fresh = clone(regressor)
    assert not hasattr(fresh, "model_") and fresh.get_params() == regressor.get_params()
    assert regressor.n_features_in_ == 4
    other = GyroceptronRegressor(**SMALL, random_state=np.random.RandomState(1)).fit(points, images)
    assert other.model_ != model


def test_a_scene_and_a_section_are_files(pairs, tmp_path):
    points, images = pairs
    # The columns as they are: a density of 1 in both planes.
    grid, one = np.linspace(-4, 4, 8), np.ones((8, 8))
    path = tmp_path / "density.npz"
    np.savez(path, x1=grid, y1=grid, density1=one, planes=2)
    regressor = GyroceptronRegressor(**SMALL, section=path).fit(points, images)
    assert regressor.model_ == gyroceptron.train(points, images, **SMALL, seed=0, section=path)
    assert regressor.model_ != GyroceptronRegressor(**SMALL).fit(points, images).model_
    with pytest.raises(ValueError, match="gone.npz"):
        GyroceptronRegressor(**SMALL, section=tmp_path / "gone.npz").fit(points, images)
    with pytest.raises(ValueError, match="gone.toml"):
        GyroceptronRegressor(scene=tmp_path / "gone.toml").fit(points, images)


def test_it_is_chosen_and_judged_by_scikit_learn(pairs):
    points, images = pairs
    regressor = GyroceptronRegressor(**SMALL)
    scores = cross_val_score(regressor, points, images, cv=2)
    assert scores.shape == (2,) and (scores > 0.98).all()
    search = GridSearchCV(regressor, {"iterations": [1, 20]}, cv=2).fit(points, images)
    assert search.best_params_ == {"iterations": 20}
    pipeline = make_pipeline(FunctionTransformer(), regressor).fit(points, images)
    assert np.array_equal(pipeline.predict(points), regressor.fit(points, images).predict(points))


def test_what_is_no_map_is_refused(pairs):
    points, images = pairs
    regressor = GyroceptronRegressor(**SMALL)
    with pytest.raises(ValueError, match="output: columns: expected 4, found 2"):
        regressor.fit(points, images[:, :2])
    with pytest.raises(ValueError, match=r"\(N, 2n\)"):
        GyroceptronRegressor(iterations=2).fit(points[:, :3], images[:, :3])
    with pytest.raises(ValueError, match="NaN"):
        regressor.fit(np.where(points > 0.9, np.nan, points), images)
    with pytest.raises(ValueError, match="kicks"):
        GyroceptronRegressor([1, 0], kicks=(0, 2)).fit(points, images)
    with pytest.raises(sklearn.exceptions.NotFittedError):
        GyroceptronRegressor().predict(points)
    with pytest.raises(ValueError, match="features"):
        regressor.fit(points, images).predict(points[:, :2])
