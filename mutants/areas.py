"""Which source files belong to which area: the one place to change when files move."""

from __future__ import annotations

from pathlib import Path

AREAS: dict[str, tuple[str, ...]] = {  # globs below the root of the tree
    "model": (
        "ctrlgen/model.py", "ctrlgen/chain.py", "ctrlgen/phi.py", "ctrlgen/motion.py", "ctrlgen/exponential.py",
        "ctrlgen/simulation.py", "ctrlgen/inverse.py", "ctrlgen/linearisation.py", "ctrlgen/effect.py", "ctrlgen/readings.py",
        "ctrlgen/controller.py", "ctrlgen/physics/*.py",
    ),
    "effects": ("ctrlgen/effects/*.py", "ctrlgen/play.py", "ctrlgen/turning.py", "ctrlgen/event.py", "ctrlgen/frame.py"),
    "recordings": (
        "ctrlgen/recording*.py", "ctrlgen/gate.py", "ctrlgen/marking.py", "ctrlgen/conditioning.py", "ctrlgen/lattice.py",
        "ctrlgen/units.py",
    ),
    "estimation": (
        "ctrlgen/diagnosis/equations.py", "ctrlgen/diagnosis/carried.py", "ctrlgen/diagnosis/mapped.py",
        "ctrlgen/diagnosis/response.py", "ctrlgen/diagnosis/noise.py", "ctrlgen/diagnosis/quiet.py",
        "ctrlgen/diagnosis/descent.py", "ctrlgen/diagnosis/fit.py", "ctrlgen/diagnosis/structure.py",
        "ctrlgen/diagnosis/learnt.py", "ctrlgen/diagnosis/profile.py", "ctrlgen/diagnosis/scatter.py",
    ),
    "selection": (
        "ctrlgen/diagnosis/weighing.py", "ctrlgen/diagnosis/adequacy.py", "ctrlgen/diagnosis/trial.py",
        "ctrlgen/diagnosis/resolved.py", "ctrlgen/diagnosis/screen.py", "ctrlgen/diagnosis/slopes.py",
        "ctrlgen/diagnosis/spread.py", "ctrlgen/diagnosis/laws.py", "ctrlgen/diagnosis/hypotheses.py",
        "ctrlgen/diagnosis/together.py", "ctrlgen/diagnosis/search.py", "ctrlgen/diagnosis/diagnosis.py",
        "ctrlgen/diagnosis/spikes.py", "ctrlgen/diagnosis/pitches.py", "ctrlgen/diagnosis/forecast.py",
    ),
    "firmware": ("ctrlgen/firmware/*.py",),
}  # fmt: skip


def files(root: Path, area: str) -> list[Path]:
    """The files of an area below `root`, sorted. Raises FileNotFoundError for a pattern that matches none: a file was moved."""
    found = set()
    for pattern in AREAS[area]:
        matched = [path for path in root.glob(pattern) if path.name != "__init__.py"]
        if not matched:
            raise FileNotFoundError(f"mutants/areas.py: {pattern} of the area {area} matches no file below {root}")
        found.update(matched)
    return sorted(found)
