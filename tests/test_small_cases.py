"""Small cases that were simulated apart from the package, each with what is left out: they stand in `shared/cases`."""

from __future__ import annotations

import pytest
from conftest import ROOT

import ctrlgen
from ctrlgen.recordings.reader import load_recordings

CASES = ROOT.parent / "shared" / "cases"
pytestmark = pytest.mark.long


def diagnosed(name):
    """The diagnosis of one case; skips where it is not on this machine."""
    folder = CASES / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is not here: the case is not part of this repository")
    device = ctrlgen.load_device(folder / "device.toml")
    return ctrlgen.diagnose(device, load_recordings([folder / "recording.toml"], ctrlgen.build_model(device)))


def at_the_noise(found) -> bool:
    """Whether no channel is left beyond its noise by more than a fifth, as thirty poses tell a noise to an eighth."""
    return all(e.rms_after < 1.2 * e.noise_floor for e in found.held_out.values())


def test_a_cable_that_drags_below_a_place_is_friction_there():
    found = diagnosed("friction_in_a_region")
    (only,) = found.findings
    assert (only.effect, only.location, found.verdict) == ("coulomb_below", "stage:axis", "explained")
    force, edge = only.parameters["force"], only.parameters["edge"]
    assert force.ci95[0] < 0.2 < force.ci95[1] and force.unit == "N"
    assert edge.value == pytest.approx(-11.5, abs=0.01) and edge.unit == "um"
    assert at_the_noise(found)


def test_a_hysteresis_that_is_not_symmetric_has_nothing_beside_it_in_poses():
    found = diagnosed("asymmetric_hysteresis_in_poses")
    (only,) = found.findings
    assert (only.effect, only.location) == ("asymmetric_displacement_hysteresis", "stage:2x")
    assert found.verdict == "explained" and at_the_noise(found)


@pytest.mark.exhaustive
def test_friction_is_found_beside_spikes_that_it_hides():
    """Spikes of one reading in a hundred, of 50 to 150 nm, where friction leaves 200 nm; the readings are those of steps of first order,
    which are a drive 5 us early."""
    found = diagnosed("spikes_and_a_missing_law")
    first = found.findings[0]
    assert first.effect in {"coulomb", "stribeck"} and first.share.value > 0.85
    assert first.parameters["force"].value == pytest.approx(5e-3, rel=0.05)
    assert at_the_noise(found)
    assert sum(s.count for s in found.spikes) == pytest.approx(
        59 + 61, rel=0.1
    )  # those of 50 nm stand nearest the rest
