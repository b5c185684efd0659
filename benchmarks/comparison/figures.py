# SPDX-License-Identifier: Apache-2.0
"""The figures of the report: the best of each simulator; tables have the rest."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from arm_sim.figures import COLORS, WIDTH, figure
from benchmarks.peers.base import OURS
from benchmarks.reporting.style import MARKS, METHODS
from benchmarks.studies.bench import Record

FAMILIES = OURS, "MuJoCo", "Drake", "SciPy", "Exudyn", "Pinocchio", "dynibo"
COLOURS = dict(zip(FAMILIES, COLORS, strict=True))
EVALUATIONS = {
    "dynibo from Python": "dynibo (Rust, from Python)",
    "Pinocchio's ABA from C++ (abaInParallel, one thread)": "Pinocchio's ABA (C++)",
    f"{OURS} generated forward dynamics from C": f"{OURS} (generated C)",
}
SHOWN = "arm_sim euler", "arm_sim rk4", "arm_sim rk4, without SIMD"  # of rollouts, and all peers
FIRST = 10.0  # [s] after which the setting of each simulator with the least drift is chosen


def draw(results: Record, out: Path) -> dict[str, str]:
    """Draw the studies that ran; returns file names by ``study:detail``, in their order."""
    return {
        f"{study}:{name}": f"{name}.png"
        for study, painter in PAINTERS.items()
        if study in results
        for name in painter(results, out)
    }


def _curve(axis: Any, points: Iterable[tuple[float, float]], label: str) -> None:
    family = _family(label)
    for key, name in METHODS.items():
        label = label.replace(f" {key}", f" {name}")
    axis.plot(
        *zip(*points, strict=True), marker=MARKS[FAMILIES.index(family)], color=COLOURS[family],
        linewidth=2.2 if family == OURS else 1.2, label=label,
    )  # fmt: skip


def _family(label: str) -> str:
    return next(family for family in FAMILIES if label.startswith(family))


def _work_precision(results: Record, out: Path) -> Iterator[str]:
    """What an error costs with the best method of each simulator, as in the table of targets."""
    points = results["work_precision"]["points"]
    lasts = {(p["robot"], p["scenario"]): p["duration_s"] for p in points}
    for robot in dict.fromkeys(robot for robot, _ in lasts):
        scenarios = [scenario for one, scenario in lasts if one == robot]
        name = f"work_precision_{robot.lower().replace(' ', '_')}"
        look: dict[str, Any] = {"size": (WIDTH, 3.4), "squeeze": False, "sharey": True}
        with figure(out / f"{name}.png", 1, len(scenarios), **look) as axes:
            for axis, scenario in zip(axes[0], scenarios, strict=True):
                here = [t for t in results["targets"]
                        if (t["robot"], t["scenario"]) == (robot, scenario)]  # fmt: skip
                for family in FAMILIES:
                    best = [(1e3 * t["cpu_s"], t["target_rad"]) for t in here
                            if t["family"] == family and t["cpu_s"]]  # fmt: skip
                    if best:
                        _curve(axis, best, family)
                axis.set(xscale="log", yscale="log",
                    title=f"{robot}: {scenario}".replace("Chain", "chain of"),
                    xlabel=f"processor time for {lasts[robot, scenario]:g} s of motion [ms]",
                )  # fmt: skip
            axes[0, 0].set_ylabel("error of joint positions [rad]")
        yield name


def _cost(results: Record, out: Path) -> Iterator[str]:
    growth = results["cost"]["growth"]
    steps = {g["who"]: _family(g["who"]) for g in growth if g["who"].lower().endswith("rk4")}
    with figure(out / "joints.png", 1, 2, (WIDTH, 3.5), sharey=True) as axes:
        for axis, title, names in (
            (axes[0], "One step of RK4", steps),
            (axes[1], "One evaluation of forward dynamics", EVALUATIONS),
        ):
            for who, name in names.items():
                if line := [(g["joints"], g["ns"] / 1e3) for g in growth if g["who"] == who]:
                    _curve(axis, line, name)
            joints = sorted({g["joints"] for g in growth})
            axis.set(xscale="log", yscale="log", xlabel="joints of the chain", title=title)
            axis.set_xticks(joints, map(str, joints), minor=False)
            axis.minorticks_off()
            axis.yaxis.set_major_formatter("{x:g}")
            axis.legend(loc="upper left")
        axes[0].set_ylabel("processor time [µs]")
    yield "joints"


def _features(results: Record, out: Path) -> Iterator[str]:
    bare = results["features"]["rows"][0]["ns"] / 1e3
    rows = sorted(results["features"]["rows"], key=lambda r: -r["ns"])
    implicit = [", implicit" in r["scene"] for r in rows]
    with figure(out / "features.png", 1, 1, (WIDTH, 0.21 * len(rows) + 1.0)) as axis:
        for i, label, color, mark in (
            (False, "RK4", COLORS[0], "o"), (True, "implicit, error control", COLORS[1], "D")
        ):  # fmt: skip
            y = [row for row in range(len(rows)) if implicit[row] is i]
            ns = [rows[row]["ns"] / 1e3 for row in y]
            axis.hlines(y, bare, ns, color, lw=2.5)
            axis.plot(ns, y, mark, color=color, ms=6, label=label)
        axis.axvline(bare, color="0.4", lw=1.0, label="bare arm")
        axis.set_yticks(range(len(rows)), [r["scene"].split(", implicit")[0] for r in rows])
        axis.set(xscale="log", xlabel="processor time of a time step of 1 ms [µs]")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.grid(axis="y", visible=False)
    yield "features"


def _rollouts(results: Record, out: Path) -> Iterator[str]:
    rows = results["rollouts"]["rows"]
    rows = [r for r in rows if r["robot"] == rows[0]["robot"]]
    with figure(out / "rollouts.png", 1, 1, (WIDTH, 3.6)) as axis:
        for who in dict.fromkeys(r["who"] for r in rows):
            line = [(r["arms"], r["arm_steps_per_s_per_core"] / 1e6)
                    for r in rows if r["who"] == who]  # fmt: skip
            if not who.startswith(OURS) or who in SHOWN:
                _curve(axis, line, who)
                lines, dashes = axis.lines, ("-", "--", ":")
                alike = [one for one in lines if one.get_color() == lines[-1].get_color()]
                lines[-1].set_linestyle(dashes[(len(alike) - 1) % len(dashes)])
        axis.set(
            xscale="log", yscale="log", xlabel="arms in one call",
            ylabel="million steps of an arm\nper second and core", title=rows[0]["robot"],
        )  # fmt: skip
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=4.0)
    yield "rollouts"


def _energy(results: Record, out: Path) -> Iterator[str]:
    """The default, and of each simulator the setting with the least drift after ``FIRST``."""
    rows = [r for r in results["energy"]["rows"] if r["drift_J"]]
    with figure(out / "energy.png", 1, 1, (WIDTH, 3.8)) as axis:
        first = sorted((r for r in rows if r["horizon_s"] == FIRST), key=lambda r: -r["drift_J"])
        best = {_family(r["who"]): r for r in first}
        for one in (r for r in first if r["who"] == f"{OURS} rk4" or r in best.values()):
            key = one["who"], one["knob"], one["setting"]
            line = [(r["horizon_s"], r["drift_J"]) for r in rows
                    if (r["who"], r["knob"], r["setting"]) == key]  # fmt: skip
            setting = f"{one['setting']:g}{' s' * (one['knob'] == 'step')}".replace("e-0", "e-")
            _curve(axis, line, f"{one['who']}, {one['knob']} {setting}")
            axis.lines[-1].set_linestyle("-" if one in best.values() else "--")
        axis.set(
            xscale="log", yscale="log", xlabel="simulated time [s]",
            ylabel="largest energy error so far [J]",
        )  # fmt: skip
        axis.xaxis.set_major_formatter("{x:g}")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    yield "energy"


def _startup(results: Record, out: Path) -> Iterator[str]:
    rows = [r for r in results["startup"]["rows"] if "Chain" in r["robot"]]
    rows.sort(key=lambda r: r["joints"])
    with figure(out / "startup.png", 1, 1, (5.2, 3.0)) as axis:
        for key, label in (("cold_s", "first start, compiles"), ("cached_s", "later starts")):
            seconds = [r[key]["total without imports"] for r in rows]
            axis.plot([r["joints"] for r in rows], seconds, "o-", label=label)
        axis.set(yscale="log", xlabel="joints of the chain", ylabel="scene to first step [s]",
                 ylim=(0.01, 2.0))  # fmt: skip
        axis.yaxis.set_major_formatter("{x:g}")
    yield "startup"


PAINTERS: dict[str, Callable[[Record, Path], Iterator[str]]] = {
    "work_precision": _work_precision,
    "cost": _cost,
    "features": _features,
    "rollouts": _rollouts,
    "energy": _energy,
    "startup": _startup,
}
