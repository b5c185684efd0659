# SPDX-License-Identifier: Apache-2.0
"""XML of robot descriptions, read as leniently as by urdfdom, for which most of them are made."""

from __future__ import annotations

import re
from xml.etree import ElementTree
from xml.parsers import expat

from arm_dynamics.exceptions import ModelError

_DECLARATION = re.compile(r"<\?xml\s.*?\?>", re.DOTALL)


def xml_root(text: str) -> ElementTree.Element:
    """The root element of an XML text.

    Namespaces are not resolved: a prefix is part of a name, declared or not, and a default
    ``xmlns`` changes no name. An XML declaration may come late.

    Raises:
        ModelError: If the text is not well-formed otherwise.
    """
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(_DECLARATION.sub("", text).encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise ModelError(f"robot description: not well-formed XML: {error}") from None
    return builder.close()
