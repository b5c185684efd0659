# SPDX-License-Identifier: Apache-2.0
"""The one-step methods by name."""

from arm_dynamics.attributes import frozen
from arm_sim.integrators import extrapolation as implicit
from arm_sim.integrators import tableaux


@frozen
class Method:
    """A one-step method.

    Attributes:
        name: Its name in scenes and arguments.
        order: Order of convergence.
        source: Its literature reference.
        tableau: Coefficients; None where the step is built in another way.
        adaptive: Whether it estimates its own error.
    """

    name: str
    order: int
    source: str
    tableau: tableaux.Tableau | None = None
    adaptive: bool = False


def _from_tableau(name: str, tableau: tableaux.Tableau) -> Method:
    return Method(name, tableau.order, tableau.source, tableau, bool(tableau.errors))


SYMPLECTIC = "Hairer, Lubich, Wanner, Geometric Numerical Integration, 2006, I.1.2"
METHODS = {
    method.name: method
    for method in (
        _from_tableau("euler", tableaux.EULER),
        Method("semi_implicit_euler", 1, SYMPLECTIC),
        _from_tableau("midpoint", tableaux.MIDPOINT),
        _from_tableau("heun", tableaux.HEUN),
        _from_tableau("rk4", tableaux.RK4),
        _from_tableau("nystrom4", tableaux.NYSTROM4),
        _from_tableau("dopri5", tableaux.DORMAND_PRINCE),
        _from_tableau("dop853", tableaux.DOP853),
        Method("implicit", implicit.ORDER, implicit.SOURCE, adaptive=True),
    )
}
"""The integration methods by name."""
