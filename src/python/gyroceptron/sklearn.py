"""A regressor for scikit-learn: the map of pairs, with ``fit``, ``predict`` and ``score``."""

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from ._native import train

__all__ = ["GyroceptronRegressor"]


class GyroceptronRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """A symplectic map P that is trained on pairs z and P(z), rows of 2n numbers, q1 ... qn, p1 ... pn.

    All parameters are keywords of :func:`gyroceptron.train`, which explains them; ``random_state`` is its ``seed``.
    After ``fit`` the attribute ``model_`` is the model, for orbits, certificates and files.

    Outputs have the shape of inputs, an even number of columns.
    """

    def __init__(
        self,
        circle_action="auto",
        *,
        recipe=None,
        scene=None,
        architecture=None,
        psi=None,
        near_identity=None,
        kicks=None,
        twists=None,
        turned_twists=None,
        perturbation=None,
        layers=None,
        radius=None,
        reversor=None,
        blocks=None,
        optimiser=None,
        iterations=None,
        starts=None,
        ramp=None,
        near_identity_penalty=None,
        loss_weights=None,
        patience=None,
        target=None,
        plateau=None,
        epsilon=None,
        flow_time=None,
        theta=None,
        theta_fixed=False,
        theta_penalty=None,
        section=None,
        units="fitted",
        validation=0.1,
        random_state=0,
    ):
        self.circle_action = circle_action
        self.recipe = recipe
        self.scene = scene
        self.architecture = architecture
        self.psi = psi
        self.near_identity = near_identity
        self.kicks = kicks
        self.twists = twists
        self.turned_twists = turned_twists
        self.perturbation = perturbation
        self.layers = layers
        self.radius = radius
        self.reversor = reversor
        self.blocks = blocks
        self.optimiser = optimiser
        self.iterations = iterations
        self.starts = starts
        self.ramp = ramp
        self.near_identity_penalty = near_identity_penalty
        self.loss_weights = loss_weights
        self.patience = patience
        self.target = target
        self.plateau = plateau
        self.epsilon = epsilon
        self.flow_time = flow_time
        self.theta = theta
        self.theta_fixed = theta_fixed
        self.theta_penalty = theta_penalty
        self.section = section
        self.units = units
        self.validation = validation
        self.random_state = random_state

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.single_output = False
        tags.input_tags.allow_nan = False
        return tags

    def fit(self, X, y):
        """Trains on pairs, (N, 2n) each; gives itself."""
        X, y = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=np.float64)
        options = self.get_params(deep=False)
        state, action = options.pop("random_state"), options.pop("circle_action")
        if not isinstance(state, (int, np.integer)):
            state = check_random_state(state).randint(2**31 - 1)
        self.model_ = train(X, y, action, seed=int(state), **options)
        return self

    def predict(self, X):
        """One step of the map from each row of (N, 2n)."""
        check_is_fitted(self, "model_")
        X = validate_data(self, X, reset=False, dtype=np.float64)
        return self.model_.predict(X, steps=1)[-1]

    def inverse_predict(self, X):
        """One step back, to rounding what :meth:`predict` began with."""
        check_is_fitted(self, "model_")
        X = validate_data(self, X, reset=False, dtype=np.float64)
        return self.model_.inverse(X)
