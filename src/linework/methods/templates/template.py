"""A template of a cross-section: nodes beside a line, each with the edge that defines it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from linework.errors import UsageError

#: What defines a node: foot or top of a step, a break of slope, a change of brightness, the middle of a painted stripe,
#: the upper edge of a rail, a wire; or nothing, where it keeps its distance.
NODE_EDGES = ("foot", "top", "break", "shade", "stripe", "rail", "wire", "fixed")
#: Farthest node from its line across and in height [m]; most nodes of a template, most templates of a survey.
FARTHEST_NODE_M, HIGHEST_NODE_M, MOST_NODES, MOST_TEMPLATES = 15.0, 15.0, 20, 100
#: Longest name, in characters.
LONGEST_NODE_NAME = 40


@dataclass(frozen=True, slots=True)
class TemplateNode:
    """A node of a template.

    Parameters
    ----------
    name
        As the surveyor calls it: "top", "gutter".
    edge
        Of `NODE_EDGES`: what defines it in the points.
    across_m, up_m
        Where it is expected from the followed line: to the right of its direction, and up. [m]
    kind, role
        Of the line along it; role "": none.
    """

    name: str
    edge: str
    across_m: float
    up_m: float
    kind: str
    role: str = ""

    @property
    def mirrored(self) -> TemplateNode:
        """The node on the other side of the line."""
        return replace(self, across_m=-self.across_m)


@dataclass(frozen=True, slots=True)
class CrossTemplate:
    """A named cross-section: the nodes beside a followed line, which is at (0, 0) itself."""

    name: str
    nodes: tuple[TemplateNode, ...]


def template_named(templates: Sequence[CrossTemplate], name: str) -> CrossTemplate:
    """Return the template with a name.

    Raises
    ------
    UsageError
        There is none.
    """
    for template in templates:
        if template.name == name:
            return template
    raise UsageError(
        f"there is no template {name[:LONGEST_NODE_NAME]!r}",
        where="template",
        advice="make it in the section",
    )
