# SPDX-License-Identifier: Apache-2.0
"""One robot written in many ways: torques are those of the numbers as written, or it is refused.

The torques are compared with an independent reading of the XML and an independent method.
"""

import re
from collections.abc import Callable

import numpy as np

from arm_dynamics import ArmModel, Dynamics, ModelError
from models.newton_euler import Robot

NEAR = 1e-12
WAYS = 40
ROBOT = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial>
    <origin xyz="0.2 0.5 -0.01" rpy="0.1 0.2 0.3"/><mass value="3.25"/>
    <inertia ixx="0.01" ixy="0.001" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.041"/>
  </inertial></link>
  <link name="plate"><inertial>
    <origin xyz="0.01 0.02 0.03"/><mass value="0.7"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/>
  </inertial></link>
  <link name="fore"><inertial>
    <origin xyz="0.1 -0.2 0.15" rpy="-0.5 0.4 0.2"/><mass value="1.5"/>
    <inertia ixx="0.011" ixy="-0.001" ixz="0" iyy="0.012" iyz="0.0005" izz="0.013"/>
  </inertial></link>
  <link name="hand"><inertial>
    <origin xyz="0 0.04 0.05" rpy="0.3 0 0"/><mass value="0.4"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/>
  </inertial></link>
  <joint name="shoulder" type="revolute">
    <origin xyz="0.1 0.3 0.1" rpy="0.4 0.5 0.6"/><axis xyz="0.6 -0.8 1"/>
    <parent link="base"/><child link="upper"/>
    <limit lower="-3" upper="2.5" effort="80" velocity="4"/>
    <dynamics damping="0.3" friction="0.2"/>
  </joint>
  <joint name="flange" type="fixed">
    <origin xyz="0.05 0.1 0.2" rpy="0.7 0 -0.3"/><parent link="upper"/><child link="plate"/>
  </joint>
  <joint name="elbow" type="continuous">
    <origin xyz="0.02 0.03 0.4" rpy="0 0.2 0.1"/><axis xyz="0 1 0.25"/>
    <parent link="plate"/><child link="fore"/><limit effort="30" velocity="6"/>
    <dynamics damping="0.15" friction="0.1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <origin xyz="0.3 0 0.02" rpy="0.2 0.1 0"/><axis xyz="0 -1 1"/>
    <parent link="fore"/><child link="hand"/>
    <limit lower="-0.5" upper="1" effort="50" velocity="2"/>
    <dynamics damping="1.5" friction="0.4"/>
  </joint>
</robot>"""

type Way = Callable[[str, np.random.Generator], str]


def with_numbers(change: Callable[[list[str], np.random.Generator], str]) -> Way:
    """The numbers of an attribute written in another way."""

    def way(text: str, rng: np.random.Generator) -> str:
        found = rng.choice(list(re.finditer(r'\w+="([-+\d. e]+)"', text)))
        return text[: found.start(1)] + change(found[1].split(), rng) + text[found.end(1) :]

    return way


def with_one(change: Callable[[str], str]) -> Way:
    """One number of an attribute written in another way."""

    def changed(words: list[str], rng: np.random.Generator) -> str:
        i = rng.integers(len(words))
        return " ".join([*words[:i], change(words[i]), *words[i + 1 :]])

    return with_numbers(changed)


def with_element(tags: str, change: Callable[[str], str]) -> Way:
    """An empty element written in another way."""

    def way(text: str, rng: np.random.Generator) -> str:
        elements = list(re.finditer(rf"<({tags})((?: [^<>]*)?)/>", text))
        if not elements:  # another way has left none
            return text
        found = rng.choice(elements)
        return text[: found.start()] + change(found[0]) + text[found.end() :]

    return way


def without(key: str, tags: str = r"\w+") -> Way:
    """An element without one of its attributes."""
    return with_element(tags, lambda words: re.sub(rf' {key}="[^"]*"', "", words))


def with_top(words: str) -> Way:
    """Something more beside links and joints."""

    def way(text: str, rng: np.random.Generator) -> str:
        ends = [found.end() for found in re.finditer("</(link|joint)>", text)]
        at = ends[rng.integers(len(ends))]
        return text[:at] + words + text[at:]

    return way


def in_other_order(text: str, rng: np.random.Generator) -> str:
    parts = re.findall(r"<(?:link|joint) .*?</(?:link|joint)>|<link [^<>]*/>", text, re.DOTALL)
    return "<robot name='arm'>" + "".join(rng.permutation(parts)) + "</robot>"


def named_alike(text: str, rng: np.random.Generator) -> str:
    joint, link = rng.choice(["flange", "elbow"]), rng.choice(["base", "upper", "fore", "hand"])
    return text.replace(f'<joint name="{joint}"', f'<joint name="{link}"')


def repeated(words: str) -> str:
    """A second element with other numbers, of which only the first counts."""
    return words + re.sub(r"\d", lambda digit: str((int(digit[0]) + 3) % 10), words)


SOUND: dict[str, Way] = {
    "blanks around": with_numbers(lambda words, _: f" \t{' '.join(words)}\n"),
    "another order": in_other_order,
    "one ulp more": with_one(lambda word: repr(float(np.nextafter(float(word), np.inf)))),
    "exponents": with_one(lambda word: f"{float(word):.16E}"),
    "a plus": with_one(lambda word: word if word.startswith("-") else f"+{word}"),
    "many digits": with_one(lambda word: f"{word}{'' if '.' in word else '.'}{'0' * 40}1"),
    "plugins": with_top("<gazebo reference='upper'><mu1>0.2</mu1><mass value='x'/></gazebo>"),
    "no products of inertia": with_element(
        "inertia", lambda words: re.sub(r' i(xy|xz|yz)="[^"]*"', "", words)
    ),
    "no axis": with_element("axis", lambda words: ""),
    "a long axis": with_element(
        "axis", lambda words: words.replace(' xyz="', ' xyz="0').replace('"/>', 'e2"/>')
    ),  # fmt: skip
    "no origin": with_element("origin", lambda words: ""),
    "no rpy": without("rpy", "origin"),
    "no losses": with_element("dynamics", lambda words: ""),
    "no damping": without("damping", "dynamics"),
    "no effort": without("effort", "limit"),
    "no inertial": lambda text, rng: re.sub(
        r"<inertial>.*?</inertial>", "", text, count=int(rng.integers(1, 5)), flags=re.DOTALL
    ),
    "repeated elements": with_element("origin|mass|inertia|axis|limit|dynamics", repeated),
    "repeated inertials": lambda text, _: text.replace(
        "</inertial>", "</inertial><inertial><mass value='5'/></inertial>"
    ),
    "names alike": named_alike,
}
NAMES = (
    r"(link|joint) '\w+'|two <\w+> are called '\w+'|a <\w+> has no name|line \d+|"
    r"one root link expected, found 2: base, floor"
)


def torques(dynamics: Dynamics, rng: np.random.Generator) -> tuple[dict[str, float], ...]:
    """A state by joint, and the torques that it needs, of the suite."""
    q, v, a = rng.uniform(-1.0, 1.0, (3, dynamics.n))
    names = dynamics.joint_names
    given = [
        dict(zip(names, x.tolist(), strict=True)) for x in (q, v, a, dynamics.inverse(q, v, a))
    ]
    return tuple(given)


def assert_as_written(text: str, rng: np.random.Generator) -> None:
    """Torques and limits are those of the independent reading."""
    dynamics, robot = Dynamics(text), Robot(text)
    *state, own = torques(dynamics, rng)
    expected = robot.torques(*state)
    assert own.keys() == expected.keys()
    size = max(1.0, *map(abs, expected.values()))
    for name, torque in own.items():
        assert abs(torque - expected[name]) <= NEAR * size, (name, torque, expected[name])
    assert_limits(dynamics.model, robot)


def assert_limits(model: ArmModel, robot: Robot) -> None:
    """A limit of zero is none."""
    for i, name in enumerate(model.joint_names):
        lower, upper, effort, velocity = robot.joints[name].limits
        assert model.effort_limit[i] == (effort or np.inf)
        assert model.velocity_limit[i] == (velocity or np.inf)
        if robot.joints[name].kind != "continuous":
            assert (model.position_lower[i], model.position_upper[i]) == (lower, upper)


def test_ways_together(rng: np.random.Generator, fuzz: int) -> None:
    """Two to five ways at a time: the torques of the numbers as written, never others."""
    sound, read = list(SOUND.values()), 0
    for _ in range(WAYS * fuzz):
        text = ROBOT
        for i in rng.choice(len(sound), rng.integers(2, 6), replace=False):
            text = sound[i](text, rng)
        try:
            assert_as_written(text, rng)
        except ModelError as error:
            assert re.search(NAMES, str(error)), error
        else:
            read += 1
    assert read > 0.9 * WAYS * fuzz
