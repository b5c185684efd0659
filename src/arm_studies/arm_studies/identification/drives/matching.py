# SPDX-License-Identifier: Apache-2.0
"""Parameters of a law by fitting simulated trajectories to measured ones.

The output-error method (Ljung, System Identification, 1999, sections 4.3 and 10.2): parameters p
and the initial state minimize the difference of simulated and measured outputs. Parameters are
positive and searched by their logarithms, so that all errors are relative.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.kernel import Call, Kernel
from arm_dynamics.exceptions import InvalidInput
from arm_studies._renaming import renamed_attribute
from arm_studies.identification.drives.law import Trial, deviation, simulation
from arm_studies.identification.drives.levenberg_marquardt import least_squares
from arm_studies.identification.regression.uncertainty import NORMAL_95

_MOST_STEPS = 512  # between two samples
# Residual over signal, and its correlation from sample to sample, above which the residual is not
# noise: another model, or a local minimum.
_SMALL, _CORRELATED = 1e-3, 0.6
# Singular values relative to the largest, and entries of singular vectors, that are zero.
_SINGULAR, _ROUNDING = 1e-9, 1e-7
_UNDETERMINED = 1e100  # deviation along a direction that the records do not determine
_VAGUE = 0.5  # relative half width of an interval above which a parameter is not identified
_WEIGHTINGS = 3  # fits, each output weighted by the residual of the one before


@frozen
class Estimate:
    """An estimated parameter.

    Attributes:
        name: Its name.
        value: In SI units.
        interval: Half the width of its 95 % confidence interval.
        determined: Whether the records determine it: ``interval`` is less than half of ``value``.
    """

    name: str
    value: float
    interval: float
    determined: bool
    found = renamed_attribute("found", "determined")


@frozen
class Match:
    """Result of a fit.

    Attributes:
        estimates: Parameters by name.
        residual: Residual relative to the variation of the outputs.
        follows: Whether the model fits the records up to noise; otherwise no estimate is valid.
        simulated: Simulated outputs of each record, shape (k, ny).
    """

    estimates: Mapping[str, Estimate]
    residual: float
    follows: bool
    simulated: tuple[Array, ...]

    def __repr__(self) -> str:
        """A summary: the parameters that the records determine, and the others."""
        lines = [f"<Match: residual {self.residual:.2%} of the variation of the records"]
        lines += [
            f"{name} {each.value:.6g} ± {each.interval:.2g}"
            for name, each in self.estimates.items() if each.determined
        ]  # fmt: skip
        if not self.follows:
            lines.append("the model does not fit the records: no parameter is identified")
        elif self.missing:
            lines.append(f"not determined by these records: {', '.join(self.missing)}")
        return "\n  ".join(lines) + ">"

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters that the records determine."""
        return {name: e.value for name, e in self.estimates.items() if e.determined}

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the parameters that the records do not determine."""
        return tuple(name for name, e in self.estimates.items() if not e.determined)


def match(trials: Sequence[Trial], guess: Mapping[str, float]) -> Match:
    """Fit the parameters of laws to trials.

    Args:
        trials: Parameters of the same name in their laws are the same parameter.
        guess: First guess of each parameter, positive.

    Returns:
        The parameters with intervals, and those that the records do not determine.

    Raises:
        InvalidInput: If nothing varies, or a guess is not positive or its trajectory not finite.
    """
    names = tuple(dict.fromkeys(name for trial in trials for name in trial.law.parameters))
    if bad := [name for name in names if not 0.0 < guess.get(name, 0.0) < np.inf]:
        raise InvalidInput(
            f"first guess of {bad[0]} = {guess.get(bad[0])}; a positive number is expected"
        )
    log_p = np.log([guess[name] for name in names])
    x0 = [np.array(trial.x0, float) for trial in trials]
    problem = _Problem(trials, names)
    problem.refine(log_p)
    for _ in range(_WEIGHTINGS):  # by each output's own noise, and steps that are short enough
        log_p, x0 = least_squares(problem.evaluate, log_p, x0)
        _, follows, _ = _fitness(problem, log_p, x0)
        # Weights are the residual of the fit: if that is no noise, they would fit its error.
        if not problem.refine(log_p) and not follows:
            break
        problem.weigh(log_p, x0)
    return _estimated(problem, log_p, x0)


class _Problem:
    """Residuals of all trials and their derivatives by log p and the states at the start."""

    def __init__(self, trials: Sequence[Trial], names: tuple[str, ...]) -> None:
        self.trials, self.names = trials, names
        self.steps = [0] * len(trials)
        self._rolls: dict[int, Call] = {}
        # By law, interval, steps and length, which the windows of a record share.
        self._kernels: dict[tuple[int, float, int, int], Call] = {}
        self.noise = [trial.size for trial in trials]  # zero: not used
        if not any(np.any(size > 0.0) for size in self.noise):
            raise InvalidInput("nothing varies in the records; motions or currents are expected")

    def refine(self, log_p: Array) -> bool:
        """Shorten steps to suit the fastest rate of each law; whether any became shorter."""
        shorter = False
        for i, trial in enumerate(self.trials):
            law, p = trial.law, self._parameters(trial, log_p)
            slopes = ca.jacobian(law.slope, law.x)
            A = ca.Function("A", [law.x, law.u, law.p], [ca.densify(slopes)])
            still = np.zeros(law.u.shape[0])
            rates = [np.linalg.eigvals(A(x, still, p).full()) for x in trial.typical_states]
            rate = float(np.max(np.abs(rates)))
            steps = int(np.clip(np.ceil(rate * trial.dt / law.longest_step), 1, _MOST_STEPS))
            steps = 1 << (steps - 1).bit_length()  # few different ones, each of which is compiled
            if steps > self.steps[i]:
                self.steps[i], shorter = steps, True
                key = id(trial.law), trial.dt, steps, len(trial.y)
                if key not in self._kernels:
                    self._kernels[key] = Kernel([simulation(trial, steps)]).call("roll")
                self._rolls[i] = self._kernels[key]
        return shorter

    def weigh(self, log_p: Array, x0: list[Array]) -> None:
        """Estimate the noise of each output by its residual."""
        for i, trial in enumerate(self.trials):
            y, _ = self.simulate(i, log_p, x0[i])
            residual = np.array([deviation(column) for column in (y - trial.y).T])
            self.noise[i] = np.maximum(residual, trial.law.accuracy * trial.size)

    def _parameters(self, trial: Trial, log_p: Array) -> Array:
        """Those of a trial's law, shape (np,)."""
        return np.exp([log_p[self.names.index(name)] for name in trial.law.parameters])

    def simulate(self, i: int, log_p: Array, x0: Array) -> tuple[Array, Array]:
        """Outputs of a trial, shape (k, ny), and their derivatives, (k, ny, own p + nx)."""
        trial, roll = self.trials[i], self._rolls[i]
        p, nx, m = self._parameters(trial, log_p), len(x0), len(trial.law.parameters)
        seed = np.hstack([np.zeros((nx, m)), np.eye(nx)]).ravel(order="F")
        k, ny = trial.y.shape
        u = np.reshape(trial.u.T, roll.inputs[1].shape)
        (outputs,) = roll(np.concatenate([x0, seed]), u, p)
        table = np.moveaxis(outputs.reshape(1 + m + nx, ny, k), 2, 0)  # (k, 1 + m + nx, ny)
        slopes = np.moveaxis(table[:, 1:], 1, 2).copy()
        slopes[..., :m] *= p  # by log p
        return table[:, 0], slopes

    def evaluate(self, log_p: Array, x0: list[Array]) -> tuple[Array, Array]:
        """Residuals over the noise of their outputs, and their derivatives."""
        rows, columns = [], []
        width = len(self.names) + sum(map(len, x0))
        place = len(self.names)
        for i, trial in enumerate(self.trials):
            y, slopes = self.simulate(i, log_p, x0[i])
            used = np.isfinite(trial.y) & (self.noise[i] > 0.0)
            size = np.where(self.noise[i] > 0.0, self.noise[i], 1.0)
            J = np.zeros((*trial.y.shape, width))
            own = [self.names.index(name) for name in trial.law.parameters]
            J[..., own] = slopes[..., : len(own)]
            J[..., place : place + len(x0[i])] = slopes[..., len(own) :]
            place += len(x0[i])
            rows.append(((y - trial.y) / size)[used])
            columns.append((J / size[:, None])[used])
        return np.concatenate(rows), np.vstack(columns)


def _estimated(problem: _Problem, log_p: Array, x0: list[Array]) -> Match:
    """Intervals by the curvature of the sum of squares (Ljung, section 9.4), and what is missing.

    A residual is at least the error of the method, so that without noise the remaining rounding
    is not taken for information.
    """
    r, J = problem.evaluate(log_p, x0)
    count = len(problem.names)
    noise = max(np.sqrt(float(r @ r) / max(len(r) - J.shape[1], 1)), 1.0)
    lengths = np.linalg.norm(J, axis=0)
    scale = np.where(lengths > 0.0, lengths, 1.0)
    _, sigma, V = np.linalg.svd(J / scale, full_matrices=False)
    spread = noise / np.maximum(sigma, 1.0 / _UNDETERMINED)
    spread[sigma < _SINGULAR * sigma[0]] = _UNDETERMINED
    part = np.where(abs(V) > _ROUNDING, V, 0.0)
    variance = np.sum((part * spread[:, None]) ** 2, axis=0)
    relative = NORMAL_95 * np.sqrt(variance[:count]) / scale[:count]
    residual, follows, simulated = _fitness(problem, log_p, x0)
    values, determined = np.exp(log_p), follows & (lengths[:count] > 0.0) & (relative < _VAGUE)
    columns = values.tolist(), (values * relative).tolist(), determined.tolist()
    rows = zip(problem.names, *columns, strict=True)
    estimates = {name: Estimate(name, *numbers) for name, *numbers in rows}
    return Match(estimates, residual, follows, simulated)


def _fitness(
    problem: _Problem, log_p: Array, x0: list[Array]
) -> tuple[float, bool, tuple[Array, ...]]:
    """Residual over signal, whether it is noise or hardly any, and the simulated outputs."""
    squares = products = signal = 0.0
    simulated = tuple(read_only(problem.simulate(i, log_p, x)[0]) for i, x in enumerate(x0))
    for trial, y in zip(problem.trials, simulated, strict=True):
        size = np.where(trial.size > 0.0, trial.size, np.inf)
        r = np.nan_to_num((y - trial.y) / size)
        squares, products = squares + np.sum(r**2), products + np.sum(r[1:] * r[:-1])
        signal += np.sum(np.isfinite(trial.y) & np.isfinite(size))
    residual = float(np.sqrt(squares / signal))
    correlation = float(products / squares) if squares else 0.0
    return residual, residual < _SMALL or correlation < _CORRELATED, simulated
