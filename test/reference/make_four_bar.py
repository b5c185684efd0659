# SPDX-License-Identifier: Apache-2.0
"""Write four_bar.json: N four-bars in a row, in their one coordinate, in closed form.

Of 2N + 1 slender rods of 1 kg and 1 m, N + 1 turn with the angle th from the horizontal and N move
as point masses at the tip: ((N+1)/3 + N) th'' = -g ((N+1)/2 + N) cos th, a pendulum with g c in
place of g. Started upright at -1 rad/s it goes round for ever: with phi = th + pi/2, counted from
the lowest position, phi'² = w² (1 - m sin²(phi/2)), so phi/2 = am(K(m) - w t/2 | m) with
w² = 1 + 4 g c and m = 4 g c / w² (Jacobi's amplitude; Whittaker, A Treatise on the Analytical
Dynamics of Particles and Rigid Bodies, §44). The script checks it against a Taylor series. Run:
python make_four_bar.py
"""

import json
from pathlib import Path

from mpmath import asin, cos, ellipfun, ellipk, fabs, mp, mpf, nint, nstr, odefun, pi, sqrt

TIMES = (1, 2, 5, 10, 20)


def stiffness(N: int) -> mpf:
    """G c in [1/s²]."""
    return mpf("9.81") * (mpf(N + 1) / 2 + N) / (mpf(N + 1) / 3 + N)


def amplitude(u: mpf, m: mpf) -> mpf:
    """Jacobi's am(u | m) for any real u."""
    half_turns = nint(u / (2 * ellipk(m)))
    return half_turns * pi + asin(ellipfun("sn", u - 2 * half_turns * ellipk(m), m=m))


def closed_form(N: int, t: int) -> tuple[mpf, mpf]:
    """Angle from the horizontal [rad] and its rate [rad/s] at time t [s]."""
    gc = stiffness(N)
    w2 = 1 + 4 * gc
    m = 4 * gc / w2
    u = ellipk(m) - sqrt(w2) * t / 2
    return 2 * amplitude(u, m) - pi / 2, -sqrt(w2) * ellipfun("dn", u, m=m)


def by_series(N: int, t: int) -> mpf:
    """The same angle from the equation of motion."""
    gc = stiffness(N)
    return odefun(lambda _, y: [y[1], -gc * cos(y[0])], 0, [pi / 2, mpf(-1)])(t)[0]


def main() -> None:
    """Compute with 30 digits, check at 2 s, keep 20."""
    mp.dps = 30
    content: dict[str, object] = {
        "about": "th [rad] from the horizontal and th' [rad/s]; 1 kg, 1 m, g 9.81 m/s^2; "
        "from pi/2 and -1"
    }
    for N in (1, 2):
        error = fabs(closed_form(N, 2)[0] - by_series(N, 2))
        assert error < mpf(10) ** -20, f"closed form and series differ by {nstr(error, 3)}"
        content[str(N)] = {t: [nstr(x, 20) for x in closed_form(N, t)] for t in TIMES}
    Path(__file__).with_name("four_bar.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
