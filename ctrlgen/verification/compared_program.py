"""One build of the generated C on this computer, and the answers that it must reproduce."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.units import same_dimension
from ctrlgen.firmware.c.real import Real
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind, entry_of
from ctrlgen.verification.host import HostBuild, passes_shipped_test, run_host
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.tolerances import rounded


@dataclass(frozen=True)
class ComparedProgram:
    """The program at `path` that a `build` made, and its `reference`."""

    build: HostBuild
    path: Path
    reference: ReferenceAnswers

    @property
    def real(self) -> Real:
        """The arithmetic in which the program computes, where it is one of real numbers."""
        assert isinstance(self.build.real, Real)
        return self.build.real

    def run(self, mode: str, records: np.ndarray, width: int, start: tuple[np.ndarray, ...] = ()) -> np.ndarray:
        """The answers of the program as `run_host` gives them."""
        return run_host(self.path, mode, records, width, start)

    def shipped_test(self) -> ComparisonEntry:
        """The self test that the package contains: 0 when it passes."""
        failed = np.array([[float(not passes_shipped_test(self.path))]])
        return entry_of(self.build, ComparisonKind.SHIPPED_TEST, "vectors", "1", failed, 0.0)

    def row(
        self, what: ComparisonKind, role: str, difference: np.ndarray, limit: float, channels: slice = slice(None)
    ) -> ComparisonEntry:
        """Some channels of a difference (n, channels) [SI] of a signal of the model, in the unit of small differences."""
        signal = self.reference.model.signals[role]
        unit = signal.units[channels][0]
        unit = {"um": "nm", "degC": "K", "urad": "rad"}.get(unit, unit)
        return entry_of(self.build, what, signal.label, unit, difference[:, channels], limit)

    def followed_channels(self) -> Iterator[tuple[str, slice]]:
        """'rad' and 'um', each with the channels of the followed signal that have its dimension; none of other dimensions."""
        units = self.reference.model.signals[self.reference.scenario.file.follow].units
        for unit in ("rad", "um"):
            if channels := [i for i, u in enumerate(units) if same_dimension(u, unit)]:
                yield unit, slice(channels[0], channels[-1] + 1)

    def off_command(self, what: ComparisonKind, off: np.ndarray, angle: float, length: float) -> list[ComparisonEntry]:
        """Of the followed signal from its command, (n, channels) [SI], with what rotations and translations may be off; of large ones
        more by the roundings of the arithmetic."""
        role, limits = self.reference.scenario.file.follow, {"rad": angle, "um": length}
        return [
            self.row(what, role, off, max(limits[unit], rounded(self.real, self.reference.path[:, span])), span)
            for unit, span in self.followed_channels()
        ]
