"""XML of other programs, read with care, and texts for XML that we write.

Documents with a document type are refused: it is where entities that grow, and files and addresses outside, are declared.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from linework.arrays import AnyArray
from linework.errors import InputError
from linework.files.input import read_input_text
from linework.files.vectors.fields import field_values, fields_of_kind
from linework.model.lines import LineSet

#: Largest file [bytes]: it is read whole, into ten times its size in memory.
_MAX_BYTES = 1 << 29
#: What XML 1.0 cannot hold, not even as a reference.
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def read_xml(path: Path, root: str) -> ElementTree.Element:
    """Return the root element of an XML file.

    Parameters
    ----------
    root
        Its expected name, without a namespace.

    Raises
    ------
    InputError
        Not XML, of another kind, with a document type, too large, or not UTF-8.
    """
    text = read_input_text(path, max_bytes=_MAX_BYTES, advice="convert it to .gpkg")
    if not text:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("XML with a document type is not read", where=path,
                         advice="remove the line <!DOCTYPE ...>")  # fmt: skip
    try:
        found = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(
            f"is not XML ({str(error)[:80]})", where=path, advice="check what this file is"
        ) from error
    if plain_tag(found) != root:
        raise InputError(f"is XML, but not {root}: its root is {plain_tag(found)[:40]}", where=path,
                         advice="check what this file is")  # fmt: skip
    return found


def plain_tag(element: ElementTree.Element) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def children(element: ElementTree.Element, *names: str) -> list[ElementTree.Element]:
    """Return the children with one of the names, in any namespace."""
    return [child for child in element if plain_tag(child) in names]


def descendants(element: ElementTree.Element, *names: str) -> Iterable[ElementTree.Element]:
    """Return the elements below with one of the names, in any namespace."""
    return (child for child in element.iter() if plain_tag(child) in names)


def xml_quoted(value: object) -> str:
    """Return a value as an attribute of XML, with its quotation marks.

    >>> print(xml_quoted('a "b" <c>'), xml_quoted("d&e"))
    'a "b" &lt;c&gt;' "d&amp;e"
    """
    return quoteattr(_NOT_IN_XML.sub("\ufffd", str(value)))


def xml_escaped(value: object) -> str:
    """Return a value as the text of an element.

    >>> xml_escaped("a < b")
    'a &lt; b'
    """
    return escape(_NOT_IN_XML.sub("\ufffd", str(value)))


def field_texts(lines: LineSet) -> list[dict[str, str]]:
    """Return the fields of each line as texts, those without a value left out."""
    values: dict[str, AnyArray] = field_values(lines)
    found = []
    for i in range(len(lines)):
        names = fields_of_kind(str(lines.kind[i]), values)
        texts = {name: value_text(values[name][i]) for name in names}
        found.append({name: text for name, text in texts.items() if text})
    return found


def value_text(value: Any) -> str:
    """Return a value of a field as text, "" for what is not known.

    >>> value_text(np.True_), value_text(0.5), value_text(np.nan), value_text("solid")
    ('true', '0.5', '', 'solid')
    """
    if isinstance(value, str | np.str_):
        return str(value)
    if isinstance(value, bool | np.bool_):
        return "true" if value else ""
    return "" if math.isnan(value) else repr(float(value))


def text_table(rows: Iterable[Mapping[str, str]]) -> dict[str, list[str | None]]:
    """Return the texts of rows as columns by name; None where a row has no such text."""
    listed = list(rows)
    names = sorted({name for row in listed for name in row})
    return {name: [row.get(name) for row in listed] for name in names}
