# SPDX-License-Identifier: Apache-2.0
"""Tables as spreadsheets, loggers and ROS write them: read, or refused by row and column."""

from pathlib import Path

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_sim import Recording
from arm_sim.recording.files.headers import Column, read_header

TIME, TAU = 0.005 * np.arange(5), np.arange(5) + 0.5
Q = np.array([0.1, -0.25, 1.5e-3, 2.0, 12.125])
ROWS = [f"{t:.3f},{q:.6f},{tau:.6f}" for t, q, tau in zip(TIME, Q, TAU, strict=True)]
HEAD = "time,position.hip,effort.hip"
PLAIN = "\n".join([HEAD, *ROWS, ""])
GERMAN = "\n".join(
    [HEAD.replace(",", ";"), *(r.replace(",", ";").replace(".", ",") for r in ROWS), ""]
)
STAMPS = [f"2025-03-30 01:59:59.{round(990 + 1e3 * t):03d}" for t in TIME[:2]]


def loaded(folder: Path, content: str | bytes) -> Recording:
    path = folder / "robot.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return Recording.load(path)


def notes(run: Recording) -> list[str]:
    return [event.text.removeprefix("file: ") for event in run.events]


def timed(*cells: object, between: str = ",") -> str:
    """A table with these times, and positions without decimals."""
    rows = (f"{cell}{between}{i}" for i, cell in enumerate(cells))
    return "\n".join([f"time{between}position.hip", *rows, ""])


@pytest.mark.parametrize(
    "content",
    {
        "of Excel": f"sep=;\r\n{GERMAN}",
        "decimal commas between tabs": GERMAN.replace(";", "\t"),
        "aligned by spaces": PLAIN.replace(",", "   "),
        "quoted": PLAIN.replace(HEAD, '"time","position.hip","effort.hip"').replace(
            "0.005,", '"0.005",'
        ),
        "comments": f"# robot 7, {HEAD}\n\n# by hand\n{PLAIN}",
        "of numpy.savetxt": "# " + PLAIN.replace(",", " "),
        "blank lines": PLAIN.replace("\n", "\n\n"),
        "UTF-8 with a mark": b"\xef\xbb\xbf" + PLAIN.encode(),
        "UTF-16": b"\xfe\xff" + PLAIN.encode("utf-16-be"),
    }.items(),
    ids=lambda pair: pair[0],
)
def test_the_same_numbers_in_many_ways(content: tuple[str, str | bytes], tmp_path: Path) -> None:
    run = loaded(tmp_path, content[1])
    np.testing.assert_array_equal(run.time, TIME)
    np.testing.assert_array_equal(run.q[:, 0], Q)
    np.testing.assert_array_equal(run.tau[:, 0], TAU)
    assert not run.events


def test_missing_cells_are_nan(tmp_path: Path) -> None:
    for cell in ("", "-nan", "N/A", "null"):
        run = loaded(tmp_path, PLAIN.replace("-0.250000", cell))
        np.testing.assert_array_equal(np.isnan(run.q[:, 0]), Q == -0.25)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (PLAIN.replace("-0.250000", "ERR"), "row 3, column 'position.hip' = 'ERR': allowed: a f"),
        (PLAIN.replace("2.000000", "1e999"), "row 5, column 'position.hip' = '1e999': allowed: a"),
        (GERMAN.replace("12,125000", "12.125"), "row 6, .*'12.125'.* in every row of the column"),
        (GERMAN.replace(";", ","), "row 2 has 6 columns, the header 3; with decimal commas, ';'"),
        (PLAIN.replace("0.010,", "0.010,7,"), "row 4 has 4 columns, the header 3"),
        (PLAIN.replace("0.010,", "0.004,"), "row 4, column 'time' = '0.004': it does not incre"),
        (PLAIN.replace("effort.", "position."), "two columns are named 'position.hip'"),
        (PLAIN.replace("effort.hip", "hip_pos"), "'position.hip' and 'hip_pos' are both the po"),
        (PLAIN.replace("position.hip", "q1").replace("effort.hip", "position.joint1"),
         "'q1' and 'position.joint1' are both the position of joint 'joint1'"),
        ("\n".join(ROWS), "row 1, column '1' = '0.000': a table without a header"),
        (PLAIN.replace("hip", "höft").encode("latin-1"), "row 1 is not UTF-8; UTF-8, or UTF-16 w"),
        (PLAIN.encode("utf-16-le"), "contains zero bytes; UTF-8, or UTF-16 with a byte-order"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_by_row_and_column(
    content: str | bytes, said: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInput, match=said):
        loaded(tmp_path, content)


@pytest.mark.parametrize(("content", "told"), [
    (timed(*STAMPS), "time counts from 2025-03-30 01:59:59.990"),
    (timed(*STAMPS, between=";").replace(".9", ",9"), "counts from 2025-03-30 01:59:59,990"),
    (timed("30.03.2025 23:59:59.998", "31.03.2025 00:00:00.003"), "counts from 30.03.2025"),
    (timed("2025-03-30T01:59:59.998Z", "2025-03-30T04:00:00.003+02:00"), "T01:59:59.998Z"),
    (timed("9:59:59.998", "10:00:00.003"), "time counts from 9:59:59.998"),
    (timed(1760000000123456789, 1760000000128456789), "read as ns since 1970"),
    (timed(1760000000123, 1760000000128), "from 1760000000123, read as ms since 1970"),
    (timed("1760000000.123456", "1760000000.128456"), "time counts from 1760000000.123456"),
    (timed(0, 5).replace("time", "time [ms]"), ""),
])  # fmt: skip
def test_times_of_calendars_and_other_units(content: str, told: str, tmp_path: Path) -> None:
    run = loaded(tmp_path, content)
    np.testing.assert_allclose(run.time, [0.0, 0.005], rtol=0.0, atol=1e-12)
    assert told in "".join(notes(run))


def test_what_may_be_meant_otherwise_is_told(tmp_path: Path) -> None:
    """A clock of an unlikely unit; columns that are not used, as the one of pandas, which has no
    name.
    """
    assert "'time' has steps of 4, read as s; " in notes(loaded(tmp_path, timed(0, 4, 8, 12)))[0]
    lines = (PLAIN.replace(HEAD, f"{HEAD} [kp cm],state") + "\n").splitlines()
    run = loaded(tmp_path, "\n".join([f",{lines[0]}", *(f"7,{x},RUN" for x in lines[1:-1]), ""]))
    np.testing.assert_array_equal(run.q[:, 0], Q)
    assert notes(run) == ["columns that are not used: without a name, effort.hip [kp cm], state"]


def test_a_last_line_that_is_cut_off_is_left_out(tmp_path: Path) -> None:
    """Wherever the writer was stopped; only a lost line end is not an incomplete line."""
    assert not notes(loaded(tmp_path, PLAIN[:-1]))
    for size in range(2, len(ROWS[-1]) + 1):
        run = loaded(tmp_path, PLAIN[:-size])
        np.testing.assert_array_equal(run.q[:, 0], Q[:4])
        assert notes(run) == ["row 6 is cut off and left out"]
    assert len(loaded(tmp_path, PLAIN.encode("utf-16")[:-5])) == 4  # within a character


# --- of ROS -------------------------------------------------------------------------------------

ECHO = "{sec},{ns},base,knee,hip,{q[1]},{q[0]},{v},{tau},{tau}\n"


def echoed(**more: str) -> str:
    """What ``ros2 topic echo --csv`` prints for joint states, by default without velocities."""
    stamps = 1_760_000_000_000_000_000 + 5_000_000 * np.arange(5)
    return "".join(
        ECHO.format_map({"sec": s // 10**9, "ns": s % 10**9, "q": (q, 2 * q), "v": "", "tau": tau}
                        | more)
        for s, q, tau in zip(stamps.tolist(), Q.tolist(), TAU.tolist(), strict=True)
    )  # fmt: skip


def test_what_ros2_topic_echo_prints(tmp_path: Path) -> None:
    run = loaded(tmp_path, echoed())
    assert run.joint_names == ("knee", "hip")
    np.testing.assert_allclose(run.time, TIME, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(run.q, np.column_stack([2 * Q, Q]))
    np.testing.assert_array_equal(run.tau, np.column_stack([TAU, TAU]))
    assert np.isnan(run.v).all()
    assert notes(loaded(tmp_path, echoed()[:-9])) == ["row 5 is cut off and left out"]

    for more, column in (({"v": "0.5"}, "10"), ({"ns": "0.5"}, "1")):
        with pytest.raises(InvalidInput, match=f"row 1, column '{column}' = .*without a header"):
            loaded(tmp_path, echoed(**more))


# --- names of columns ----------------------------------------------------------------------------


@pytest.mark.parametrize("names", [
    ("Time [s]", "hip_position", "hip_effort"),
    ("t", "q_hip [rad]", "tau_hip [Nm]"),
    ("timestamp", "pos_hip", "torque_hip"),
    ("__time", "/joint_states/hip/position", "/joint_states/hip/effort"),
])  # fmt: skip
def test_the_same_table_under_many_names(names):
    header = read_header(names)
    assert header.clock == Column(0)
    assert header.joints == ("hip",)
    assert header.columns == {("position", "hip"): Column(1), ("effort", "hip"): Column(2)}


def test_units_in_brackets_are_read():
    columns = ["time_ms", "hip.pos [deg]", "hip.vel (deg/s)", "slide_q [mm]", "hip.tau [turns]"]
    header = read_header(columns)
    assert header.clock == Column(0, 1e-3)
    factors = [column.factor for column in header.columns.values()]
    np.testing.assert_allclose(factors, [np.pi / 180.0, np.pi / 180.0, 1e-3])


@pytest.mark.parametrize("first", [0, 1])
def test_numbered_joints(first):
    header = read_header(["t", *(f"{what}{first + i}" for what in ("q", "tau") for i in range(3))])
    assert header.joints == ("joint1", "joint2", "joint3")
    assert header.columns["effort", "joint3"] == Column(6)


def test_names_that_hold_such_words_are_left_whole():
    header = read_header(["time", "position.left/q_elbow_pos", "effort.left/q_elbow_pos", "q_²"])
    assert header.joints == ("left/q_elbow_pos", "²")
