# SPDX-License-Identifier: Apache-2.0
"""XML of robot descriptions, read as leniently as by urdfdom, for which most of them are made."""

import re
from xml.etree import ElementTree
from xml.parsers import expat

from arm_dynamics.exceptions import ModelError

# Each also matches to the end of a text that never ends it, so that the time is linear.
_ASIDE = re.compile(r"<!\[CDATA\[.*?(?:\]\]>|\Z)|<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)", re.DOTALL)
_DECLARATION = re.compile(r"<\?xml\s.*\?>", re.DOTALL)


def xml_root(text: str) -> ElementTree.Element:
    """The root element of an XML text.

    Namespaces are not resolved: a prefix is part of a name, declared or not, and a default
    ``xmlns`` changes no name. An XML declaration may come late, and comments may contain ``--``.

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
        parser.Parse(_plain(text).encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise ModelError(f"robot description: not well-formed XML: {error}") from None
    return builder.close()


def _plain(text: str) -> str:
    """The text with spaces in place of comments and declarations: lines and columns are kept."""
    nested = False

    def blank(aside: re.Match[str]) -> str:
        nonlocal nested
        comment = aside[0].startswith("<!--") and aside[0].endswith("-->")
        nested |= comment and "<!--" in aside[0][4:]
        keeps = not (comment or _DECLARATION.fullmatch(aside[0]))
        return aside[0] if keeps else re.sub(r"[^\r\n]", " ", aside[0])

    text = _ASIDE.sub(blank, text)
    if nested and "-->" in text:
        line = text.count("\n", 0, text.index("-->")) + 1
        raise ModelError(
            f"robot description: line {line}: '-->' ends no comment: one with another in it ends "
            "at the first '-->'"
        )
    return text
