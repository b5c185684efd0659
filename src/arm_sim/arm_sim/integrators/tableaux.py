# SPDX-License-Identifier: Apache-2.0
"""Butcher tableaux of the explicit Runge-Kutta methods.

Notation and most tableaux: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I,
2nd edition 1993 ("HNW").
"""

from collections.abc import Mapping, Sequence

import casadi as ca

from arm_dynamics.attributes import frozen


@frozen
class Tableau:
    """Coefficients of an explicit Runge-Kutta method.

    There are no nodes c, since f does not depend on time.

    Attributes:
        order: Order of convergence.
        a: Row i holds the weights of stages 0 … i-1.
        b: Weights of the result.
        source: Its literature reference.
        errors: Weights of error estimates (b minus the embedded method's), none if it has none.
        positions: Weights ā of the accelerations in the positions, of Nyström's methods for
            q'' = f(q, q'): row i holds those of stages 0 … i-1, the last row those of the result.
    """

    order: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    source: str
    errors: tuple[tuple[float, ...], ...] = ()
    positions: tuple[tuple[float, ...], ...] = ()


def weighted_sum(
    weights: Sequence[float], slopes: Sequence[ca.MX] | Mapping[int, ca.SX], like: ca.MX | ca.SX
) -> ca.MX | ca.SX:
    """Σ w_i k_i over the stages that a method uses; zeros of the size of ``like`` if none."""
    total = type(like)(like.shape[0], 1)
    for i, weight in enumerate(weights):
        if weight:
            total = total + weight * slopes[i]
    return total


EULER = Tableau(1, ((),), (1.0,), "Euler, Institutiones calculi integralis I, 1768; HNW I.7")

MIDPOINT = Tableau(2, ((), (0.5,)), (0.0, 1.0), "Runge, Math. Ann. 46, 1895; HNW II.1")

HEUN = Tableau(2, ((), (1.0,)), (0.5, 0.5), "Heun, Z. Math. Phys. 45, 1900; HNW II.1")

RK4 = Tableau(
    4,
    ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    (1 / 6, 1 / 3, 1 / 3, 1 / 6),
    "Kutta, Z. Math. Phys. 46, 1901; HNW II.1",
)

# Velocities and internal states as RK4; the second and the third stage are at one position.
NYSTROM4 = Tableau(
    4,
    RK4.a,
    RK4.b,
    "Nyström, Acta Soc. Sci. Fennicae 50(13), 1925; HNW II.14",
    positions=((), (1 / 8,), (1 / 8,), (0.0, 0.0, 1 / 2), (1 / 6, 1 / 6, 1 / 6)),
)

# Weights of the methods of order 5 and, for the estimate of the error, 4
_DP_B = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0)
_DP_B4 = (5179 / 57600, 0.0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40)

DORMAND_PRINCE = Tableau(
    5,
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
        _DP_B[:6],
    ),
    _DP_B,
    "Dormand, Prince, J. Comput. Appl. Math. 6(1), 1980; HNW II.5",
    errors=(tuple(b - b4 for b, b4 in zip(_DP_B, _DP_B4, strict=True)),),
)

DOP853 = Tableau(
    8,
    (
        (),
        (0.05260015195876773,),
        (0.0197250569845379, 0.0591751709536137),
        (0.02958758547680685, 0.0, 0.08876275643042054),
        (0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792),
        (0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242),
        (0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125),
        (0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328,
         -0.015319437748624402, 0.008273789163814023),
        (0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726,
         27.59209969944671, 20.154067550477894, -43.48988418106996),
        (0.47766253643826434, 0.0, 0.0, -2.4881146199716677, -0.590290826836843,
         21.230051448181193, 15.279233632882423, -33.28821096898486, -0.020331201708508627),
        (-0.9371424300859873, 0.0, 0.0, 5.186372428844064, 1.0914373489967295,
         -8.149787010746927, -18.52006565999696, 22.739487099350505, 2.4936055526796523,
         -3.0467644718982196),
        (2.273310147516538, 0.0, 0.0, -10.53449546673725, -2.0008720582248625,
         -17.9589318631188, 27.94888452941996, -2.8589982771350235, -8.87285693353063,
         12.360567175794303, 0.6433927460157636),
    ),
    (0.054293734116568765, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003,
     -5.801203960010585, 0.3111643669578199, -0.1521609496625161, 0.20136540080403034,
     0.04471061572777259),
    "Prince, Dormand, J. Comput. Appl. Math. 7(1), 1981; HNW II.10 and its program DOP853",
    errors=(
        (0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502,
         1.6643771824549864, -0.35032884874997366, 0.3341791187130175, 0.08192320648511571,
         -0.022355307863886294),
        (-0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003,
         -5.801203960010585, -0.4226823213237919, -0.1521609496625161, 0.20136540080403034,
         0.02265179219836082),
    ),
)  # fmt: skip
