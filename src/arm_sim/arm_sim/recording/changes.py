# SPDX-License-Identifier: Apache-2.0
"""Changes during a run: of tunable quantities, or of the state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_sim.plant.plant import Plant


@dataclass(frozen=True)
class Jump:
    """A change between two ticks.

    Attributes:
        row: Row of the recording with the time of the change and the state after it.
        x: State before, shape (nx,).
        p: Tunable quantities before, shape (np,).
        tunable: Names of those that were tunable before.
        substep: Next trial sub-step of the error control in [s]; see ``Simulator.substep``.
    """

    row: int
    x: Array
    p: Array
    tunable: tuple[str, ...] = ()
    substep: float = 0.0


class _Changing(Protocol):
    @property
    def plant(self) -> Plant: ...

    @property
    def parameters(self) -> Array: ...

    @property
    def x(self) -> Array: ...

    @property
    def substep(self) -> float: ...


class Changes:
    """Records changes that a controller makes in its simulation.

    Args:
        simulator: The simulator at the start of a run.
    """

    def __init__(self, simulator: _Changing) -> None:
        self._simulator = simulator
        self._rows, self._states, self._substeps = [0], list[Array](), list[float]()
        self._holds = dict[int, int]()
        self._tuned, self._last = [self._present()], self._token()

    def look(self, row: int, x: Array) -> None:
        """Compare with the last call; a changed state is written to its row of ``x``."""
        token, here = self._token(), self._simulator.x
        if token == self._last and here.tobytes() == x[row].tobytes():
            return
        self._rows.append(row)
        self._tuned.append(self._present())
        self._states.append(x[row].copy())
        self._substeps.append(self._simulator.substep)
        self._last, x[row] = token, here

    def held(self, row: int, how: int) -> None:
        """Record what held the arm (servos or brakes) in the tick that begins at a row."""
        self._holds[row] = how

    def hold(self, rows: int) -> NDArray[np.uint8] | None:
        """What held the arm in the tick from each time, shape (rows,); None if nothing did."""
        if not self._holds:
            return None
        hold = np.zeros(rows, np.uint8)
        hold[list(self._holds)] = list(self._holds.values())
        return hold

    def parameters(self, rows: int) -> Array:
        """Tunable quantities from each time, shape (rows, np)."""
        ends = [*self._rows[1:], rows]
        parts = [
            np.broadcast_to(self._merged(tuned), (max(0, end - first), self._size))
            for first, end, tuned in zip(self._rows, ends, self._tuned, strict=True)
        ]
        return read_only(np.concatenate(parts))

    def jumps(self) -> tuple[Jump, ...]:
        """The changes in chronological order."""
        before = zip(self._rows[1:], self._states, self._tuned, self._substeps, strict=False)
        return tuple(
            Jump(row, read_only(x), self._merged(tuned), tuple(tuned), substep)
            for row, x, tuned, substep in before
        )

    @property
    def _size(self) -> int:
        return len(self._simulator.plant.parameters.nominal)

    def _token(self) -> tuple[Plant, bytes]:
        """A key that differs if a tunable quantity does."""
        return self._simulator.plant, self._simulator.parameters.tobytes()

    def _present(self) -> dict[str, bytes]:
        """Current values by name, since a run may make more of them tunable."""
        parameters, p = self._simulator.plant.parameters, self._simulator.parameters
        return {name: parameters.of(name, p).tobytes() for name in parameters.names}

    def _merged(self, tuned: dict[str, bytes]) -> Array:
        parameters = self._simulator.plant.parameters
        values = {name: np.frombuffer(value) for name, value in tuned.items()}
        return parameters.merged(values, parameters.nominal)
