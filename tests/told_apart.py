"""Which series of a drawing, or of a figure that zooms, only their colour tells apart."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from typing import Any

SPACE = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"


def alike_in_drawing(svg: str) -> list[str]:
    """Entries of the legends of a drawing whose dashes and marks are those of another one."""
    root = ET.fromstring(svg)
    shapes = {path.get("id"): path.get("d") for path in root.iter(f"{SPACE}path") if path.get("id")}
    found = []
    for legend in root.iter(f"{SPACE}g"):
        if not (legend.get("id") or "").startswith("legend"):
            continue
        drawn = [_drawn(g, shapes) for g in legend.iter(f"{SPACE}g") if (g.get("id") or "").startswith("line2d")]
        found += [f"{legend.get('id')}: {style}" for style in {s for s in drawn if drawn.count(s) > 1}]
    return found


def _drawn(group: ET.Element, shapes: dict[str | None, str | None]) -> tuple[Any, ...]:
    """Dashes of the line, shape of the marker and whether it is filled."""
    lines = [e for e in group.iter(f"{SPACE}path") if not e.get("id")]
    dash = [re.search(r"stroke-dasharray: ([^;]*)", e.get("style") or "") for e in lines]
    marks = [
        (shapes.get((e.get(LINK) or "")[1:]), "fill: none" in (e.get("style") or "")) for e in group.iter(f"{SPACE}use")
    ]
    return tuple(d[1] if d else "solid" for d in dash), tuple(marks)


def alike_in_chart(chart: str) -> list[str]:
    """Curves of one panel of the data of a figure that zooms, whose dashes and marks are those of another one."""
    found = []
    for panel in json.loads(chart)["panels"]:
        drawn = [c["mark"] or str(c["dash"]) for c in panel["curves"]]
        found += [
            f"{panel['label']}: {c['name']}"
            for c, style in zip(panel["curves"], drawn, strict=True)
            if drawn.count(style) > 1
        ]
    return found
