# SPDX-License-Identifier: Apache-2.0
"""Formulas of lecture notes for one rigid body, as docs/concepts/errata.md gives them corrected.

The body is a cloud of point masses, so that every integral is a sum of its own.
"""

import numpy as np
import pytest

from tolerances import CLOSED_FORM, assert_close

X, Y, Z = range(3)


class Cloud:
    """A rigid body of twelve point masses, by their places about its centre of mass."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.m = rng.uniform(0.1, 1.0, 12)
        r = rng.normal(size=(12, 3))
        self.r = r - self.m @ r / self.m.sum()
        self.inertia = np.einsum(
            "k,kij->ij", self.m, [(p @ p) * np.eye(3) - np.outer(p, p) for p in self.r]
        )


@pytest.fixture
def body(rng: np.random.Generator) -> Cloud:
    return Cloud(rng)


def test_centre_of_mass_is_divided_by_the_mass(rng: np.random.Generator) -> None:
    """Centre = (1/m) ∫ ρ r dV: of a box of density 3 about its middle; not without 1/m."""
    size, middle, density = np.array([0.5, 0.2, 0.4]), np.array([1.0, -2.0, 0.3]), 3.0
    corner = middle - size / 2
    cells = corner + (
        np.stack(np.meshgrid(*3 * [np.arange(10)]), axis=-1).reshape(-1, 3) + 0.5
    ) * (size / 10)
    moment = (density * np.prod(size) / 1000 * cells).sum(axis=0)
    mass = density * np.prod(size)
    assert_close(moment / mass, middle, CLOSED_FORM)
    assert not np.allclose(moment, middle, rtol=0.1)


def test_products_of_inertia_are_added_in_the_kinetic_energy(
    body: Cloud, rng: np.random.Generator
) -> None:
    """K = ½ Σ I_ii ω_i² + Σ I_ij ω_i ω_j, since I_xy = -∫ xy dm carries the sign already."""
    w, J = rng.normal(size=3), body.inertia
    assert_close(J[X, Y], -(body.m * body.r[:, X] * body.r[:, Y]).sum(), CLOSED_FORM)
    assert_close(J, J.T, CLOSED_FORM)  # I_zx stands in the last row, and I_zy once
    speed = np.cross(w, body.r)
    K = 0.5 * (body.m * (speed**2).sum(axis=1)).sum()
    products = J[X, Y] * w[X] * w[Y] + J[Y, Z] * w[Y] * w[Z] + J[Z, X] * w[Z] * w[X]
    assert_close(0.5 * (np.diag(J) * w**2).sum() + products, K, CLOSED_FORM)
    assert not np.isclose(0.5 * (np.diag(J) * w**2).sum() - products, K, rtol=1e-3)


def moment(body: Cloud, w: np.ndarray, dw: np.ndarray) -> np.ndarray:
    """Σ r × m r̈ with r̈ = ω̇ × r + ω × (ω × r), about the centre of mass."""
    a = np.cross(dw, body.r) + np.cross(w, np.cross(w, body.r))
    return np.asarray((body.m[:, None] * np.cross(body.r, a)).sum(axis=0))


def test_euler_equation_by_components(body: Cloud, rng: np.random.Generator) -> None:
    """As printed; the products of inertia are those of the matrix, with their sign."""
    w, dw = rng.normal(size=3), rng.normal(size=3)
    x, y, z = w
    J = body.inertia
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = J
    M = J @ dw + [
        -(yy - zz) * y * z - yz * (z**2 - y**2) - x * (z * xy - y * xz),
        -(zz - xx) * z * x - xz * (x**2 - z**2) - y * (x * yz - z * xy),
        -(xx - yy) * x * y - xy * (y**2 - x**2) - z * (y * xz - x * yz),
    ]
    assert_close(M, moment(body, w, dw), CLOSED_FORM)


def test_euler_equation_in_principal_axes(body: Cloud, rng: np.random.Generator) -> None:
    """M₁ = I₁ ω̇₁ - (I₂ - I₃) ω₂ ω₃; as printed, with I₂ - I₂, nothing would turn it."""
    principal, axes = np.linalg.eigh(body.inertia)
    axes[:, 0] *= np.linalg.det(axes)  # right-handed
    w, dw = rng.normal(size=3), rng.normal(size=3)
    I1, I2, I3 = principal
    M = principal * dw - [
        (I2 - I3) * w[1] * w[2],
        (I3 - I1) * w[2] * w[0],
        (I1 - I2) * w[0] * w[1],
    ]
    assert_close(M, axes.T @ moment(body, axes @ w, axes @ dw), CLOSED_FORM)
    assert not np.isclose(I1 * dw[0], M[0], rtol=1e-3)


def test_moment_of_momentum_of_a_body_has_a_part_of_its_own(
    body: Cloud, rng: np.random.Generator
) -> None:
    """About a fixed point L = r_C × p + I ω, of which r_C × p alone is a point mass."""
    centre, v, w = rng.normal(size=(3, 3))
    speeds = v + np.cross(w, body.r)
    L = (body.m[:, None] * np.cross(centre + body.r, speeds)).sum(axis=0)
    of_centre = np.cross(centre, body.m.sum() * v)
    assert_close(of_centre + body.inertia @ w, L, CLOSED_FORM)
    assert not np.allclose(of_centre, L, rtol=1e-2)


def test_kinetic_energy_splits_about_the_centre_of_mass(
    body: Cloud, rng: np.random.Generator
) -> None:
    """T = ½ Vᵀ diag(m 1, I) V with V = (v, ω) at the centre of mass, and at no other point."""
    v, w, elsewhere = rng.normal(size=(3, 3))
    speeds = v + np.cross(w, body.r)
    T = 0.5 * (body.m * (speeds**2).sum(axis=1)).sum()
    M = np.block([
        [body.m.sum() * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), body.inertia]
    ])  # fmt: skip
    V = np.concatenate([v, w])
    assert_close(0.5 * V @ M @ V, T, CLOSED_FORM)
    V = np.concatenate([v + np.cross(w, elsewhere), w])
    assert not np.isclose(0.5 * V @ M @ V, T, rtol=1e-3)


def test_rate_of_momentum_in_the_axes_of_the_body(rng: np.random.Generator) -> None:
    """F_y = m a_y - m (ω_x v_z - ω_z v_x), where a_y is the rate of the component v_y."""
    m, h = 2.0, 1e-6
    w, v, dv = rng.normal(size=(3, 3))
    turned = np.cross(np.broadcast_to(w, (3, 3)), np.eye(3)).T  # ω ×
    ahead, behind = (
        (np.eye(3) + s * turned + 0.5 * s**2 * turned @ turned) @ (v + s * dv) for s in (h, -h)
    )
    F = [
        m * dv[X] + m * (w[Y] * v[Z] - w[Z] * v[Y]),
        m * dv[Y] - m * (w[X] * v[Z] - w[Z] * v[X]),
        m * dv[Z] + m * (w[X] * v[Y] - w[Y] * v[X]),
    ]
    np.testing.assert_allclose(m * (ahead - behind) / (2 * h), F, atol=1e-8)


def test_generalized_force_is_differentiated_by_its_own_coordinate(
    rng: np.random.Generator,
) -> None:
    """F_r = Σ (F_x ∂f/∂q_r + F_y ∂g/∂q_r + F_z ∂h/∂q_r), each by q_r; not by q₁, q₂, q_n.

    A force at the end of the second link, by the work that a small motion takes.
    """
    l1, l2, h = 0.6, 0.4, 1e-6
    q, force = rng.uniform(0.3, 1.2, 2), rng.normal(size=2)

    def end(q: np.ndarray) -> np.ndarray:
        both = q.sum()
        return np.array([
            l1 * np.cos(q[0]) + l2 * np.cos(both), l1 * np.sin(q[0]) + l2 * np.sin(both)
        ])  # fmt: skip

    steps = h * np.eye(2)
    work = [force @ (end(q + s) - end(q - s)) / (2 * h) for s in steps]
    s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
    df, dg = [-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]
    np.testing.assert_allclose(
        [force[0] * df[r] + force[1] * dg[r] for r in (0, 1)], work, atol=1e-8
    )
    assert not np.isclose(force[0] * df[0] + force[1] * dg[1], work[0], rtol=1e-3)


def test_moment_equation_is_about_a_fixed_point(body: Cloud, rng: np.random.Generator) -> None:
    """M = dL/dt about a fixed point; about one that moves at ṗ, M = dL/dt + ṗ × m v_C."""
    w, dw, centre, v, dv, p, dp = rng.normal(size=(7, 3))
    velocities = v + np.cross(w, body.r)
    accelerations = dv + np.cross(dw, body.r) + np.cross(w, np.cross(w, body.r))
    arms = centre + body.r - p
    moments = (body.m[:, None] * np.cross(arms, accelerations)).sum(axis=0)
    rates = np.cross(velocities - dp, velocities) + np.cross(arms, accelerations)
    rate = (body.m[:, None] * rates).sum(axis=0)
    assert_close(rate + np.cross(dp, body.m.sum() * v), moments, 10 * CLOSED_FORM)
    assert not np.allclose(rate, moments, rtol=1e-3)


def test_generalized_force_is_a_sum_over_particles(rng: np.random.Generator) -> None:
    """Five forces on a rod that turns about its end: one coordinate, five terms."""
    q, places, forces = 0.7, rng.uniform(0.1, 1.0, 5), rng.normal(size=(5, 2))
    across = np.array([-np.sin(q), np.cos(q)])  # ∂(f, g)/∂q of each is its place along this
    moment = sum(
        r * (np.cos(q) * F[Y] - np.sin(q) * F[X]) for r, F in zip(places, forces, strict=True)
    )
    assert_close(places @ forces @ across, moment, CLOSED_FORM)
    assert not np.isclose(places[0] * forces[0] @ across, moment, rtol=1e-3)
