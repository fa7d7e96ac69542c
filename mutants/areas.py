"""Which source files belong to which area: the one place to change when files move."""

from __future__ import annotations

from pathlib import Path

# Globs below the root of the tree
AREAS: dict[str, tuple[str, ...]] = {
    "model": (
        "ctrlgen/model/*.py",
        "ctrlgen/controller/*.py",
        "ctrlgen/numerics/*.py",
        "ctrlgen/physics/*.py",
    ),
    "effects": ("ctrlgen/effects/*.py",),
    "recordings": ("ctrlgen/recordings/*.py", "ctrlgen/core/units.py"),
    "estimation": ("ctrlgen/estimation/*.py",),
    "selection": (
        "ctrlgen/diagnosis/selection/*.py",
        "ctrlgen/diagnosis/settings/selection.py",
    ),
    "firmware": ("ctrlgen/firmware/**/*.py",),
    "accuracy": (
        "ctrlgen/budget/*.py",
        "ctrlgen/calibration/*.py",
        "ctrlgen/learning/*.py",
        "ctrlgen/path_timing/*.py",
    ),
    "trajectory": ("ctrlgen/trajectory/**/*.py",),
    "devices": ("ctrlgen/devices/**/*.py",),
}


def files(root: Path, area: str) -> list[Path]:
    """The files of an area below `root`, sorted. Raises FileNotFoundError for a pattern that matches none: a file was moved."""
    found = set()
    for pattern in AREAS[area]:
        matched = [path for path in root.glob(pattern) if path.name != "__init__.py"]
        if not matched:
            raise FileNotFoundError(f"mutants/areas.py: {pattern} of the area {area} matches no file below {root}")
        found.update(matched)
    return sorted(found)
