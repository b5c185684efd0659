# SPDX-License-Identifier: Apache-2.0
"""Types of numbers in a scene, and the base class of its parts."""

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from arm_dynamics.arrays import unit
from arm_dynamics.attributes import not_assignable
from arm_dynamics.exceptions import plain


def _number(value: object) -> object:
    """Convert ``1e5``, which YAML 1.1 reads as text, and refuse Booleans as numbers."""
    if isinstance(value, bool):
        raise ValueError("a number is expected, not true or false")
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            raise ValueError("a number is expected") from None
    return value


# Slopes of curves are below it, so that products of them can be computed
LARGEST_SLOPE = 1e100
_COPY = "build another one: load_scene takes a file, or a dict of the same shape"
# Context of a validation of content that was checked before and must not change
AS_CHECKED = {"as checked": True}


def _unit(value: tuple[float, float, float], info: ValidationInfo) -> tuple[float, float, float]:
    """A nonzero direction, normalized to unit length."""
    if info.context is AS_CHECKED:
        return value  # normalizing again might change its last bit
    if math.hypot(*value) < 1e-9:
        raise ValueError("a direction must not be zero")
    x, y, z = unit(value).tolist()
    return x, y, z


Finite = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_number)]
NonNegative = Annotated[Finite, Field(ge=0.0)]
Positive = Annotated[Finite, Field(gt=0.0)]
Limit = Annotated[float, BeforeValidator(_number), Field(ge=0.0)]
Vector3 = tuple[Finite, Finite, Finite]
Direction = Annotated[Vector3, AfterValidator(_unit)]
Inertia6 = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Part(BaseModel):
    """A part of a scene: immutable, with unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def __repr_args__(self) -> Iterator[tuple[str, object]]:
        """The keys that are set; of long text, as of a robot description, its ends."""
        for name in type(self).model_fields:
            if name in self.model_fields_set:
                value = getattr(self, name)
                yield name, plain(value, 60) if isinstance(value, str) else value

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse to be changed."""
        if not name.startswith("_"):
            raise not_assignable(self, name, type(self).model_fields, _COPY)
        super().__setattr__(name, value)


def check_curve(key: str, at: Sequence[float], **rows: Sequence[float]) -> None:
    """Refuse points that no curve passes through.

    Abscissas, named by a key, must increase; rows of values, each named by its key, must be as
    long, and not too steep for their slopes to be computed.
    """
    steps = np.diff(at)
    for name, row in rows.items():
        if len(row) != len(at):
            raise ValueError(f"{len(at)} points of '{key}', but {len(row)} of '{name}'")
    if not (steps > 0.0).all():
        raise ValueError(f"'{key}' must increase from point to point")
    with np.errstate(over="ignore"):
        steepest = max((abs(np.diff(row) / steps).max() for row in rows.values()), default=0.0)
    if not steepest < LARGEST_SLOPE:
        raise ValueError(
            f"'{key}' = {list(at)}: a slope of {steepest:.3g} between two points; less than "
            f"{LARGEST_SLOPE:g} is expected"
        )
