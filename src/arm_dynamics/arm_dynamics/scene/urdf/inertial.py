# SPDX-License-Identifier: Apache-2.0
"""Inertias written into a robot description in place of its own."""

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from arm_dynamics.scene.inertia import Body
from arm_dynamics.scene.urdf.plain import TENSOR
from arm_dynamics.scene.urdf.xml import xml_root


def with_bodies(text: str, bodies: Mapping[str, Body]) -> str:
    """A robot description in which some links have other inertias.

    The text is unchanged if there are none; names of no link change nothing.

    Args:
        text: URDF as XML.
        bodies: The inertias by link, in the frame of the link.

    Raises:
        ModelError: If the text is not well-formed.
    """
    if not bodies:
        return text
    root = xml_root(text)
    for link in root.findall("link"):
        if (body := bodies.get(link.get("name", ""))) is not None:
            set_inertial(link, body.mass, body.com, body.inertia)
    return ElementTree.tostring(root, encoding="unicode")


def set_inertial(
    link: ElementTree.Element, mass: float, com: Iterable[float], inertia: Iterable[float]
) -> None:
    """Write the inertia of a <link> in place of its own, such that it is read bit for bit.

    Args:
        link: The element, which is changed.
        mass: Mass in [kg].
        com: Centre of mass in the frame of the link, in [m], shape (3,).
        inertia: ixx, ixy, ixz, iyy, iyz, izz about it in [kg m²], along the axes of the link.
    """
    for old in link.findall("inertial"):
        link.remove(old)
    inertial = ElementTree.SubElement(link, "inertial")
    place = " ".join(repr(float(x)) for x in com)
    ElementTree.SubElement(inertial, "origin", xyz=place, rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    six = {key: repr(float(x)) for key, x in zip(TENSOR, inertia, strict=True)}
    ElementTree.SubElement(inertial, "inertia", six)
