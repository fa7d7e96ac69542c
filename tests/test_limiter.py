"""The limiter in Python (`Controller.step`) and in C (codegen/limiter) answer alike on every combination of their branches.

The two are written separately, so each is the other's check; docs/limiter.md says why. The devices here are not physical:
their kernels are exact in binary arithmetic (sums, products, a saw-tooth), and present state and target choose the branch
of every decision, so that all combinations are visited and the answers can be compared bit by bit.
"""

from __future__ import annotations

import gzip
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import coverage
import numpy as np
import pytest
from scripted_limiter import (
    DEVICES,
    NOWHERE,
    PATIENCE,
    TRIALS,
    Device,
    N,
    combination,
    drives,
    grows,
    last_drive,
    odd_cases,
    sample,
    scripted,
    spoilt_drives,
)

from ctrlgen import Controller, ControllerStatus
from ctrlgen.controller import feedforward
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.online.online import online_context


def answer(step) -> np.ndarray:
    return np.concatenate([[int(step.status)], step.drive, step.displacement, step.actuator_state, *step.state])


MAIN = """
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "limiter.h"
#define BAD LIMITER_INPUT
int main(void)
{
    double in[1 + NX + N + N + NU];
    limiter_state s;
    limiter_output o;
    limiter_init(NULL);
    limiter_init(&s);
    if (limiter_settle(NULL, in, &o) != BAD || limiter_settle(&s, NULL, &o) != BAD || limiter_settle(&s, in, NULL) != BAD) {
        return 1;
    }
#ifdef MOVING
    if (limiter_step(NULL, in, &o) != BAD || limiter_step(&s, NULL, &o) != BAD || limiter_step(&s, in, NULL) != BAD) {
        return 1;
    }
#endif
    while (fread(in, sizeof in[0], 1 + NX + N + N + NU, stdin) == 1 + NX + N + N + NU) {
        double out[1];
        int lost = 0;
#if NX > 0
        memcpy(s.x, in + 1, sizeof s.x);
#endif
        memcpy(s.z, in + 1 + NX, sizeof s.z);
#if NU > 0
        memcpy(s.u, in + 1 + NX + N + N, sizeof s.u);
#endif
        if (isnan(s.z[0]) && isnan(s.z[1]) && isnan(s.z[2])) {
            memset(&s, 0, sizeof s);
        }
#ifdef MOVING
        out[0] = in[0] != 0.0 ? limiter_step(&s, in + 1 + NX + N, &o) : limiter_settle(&s, in + 1 + NX + N, &o);
#else
        out[0] = limiter_settle(&s, in + 1 + NX + N, &o);
#endif
        if (s.ready == 0U) { /* lost: in Python no number of the state is one then */
            int i;
            for (i = 0; i < N; i++) {
                s.z[i] = NAN;
#if NU > 0
                s.u[i] = NAN;
#endif
            }
#if NX > 0
            for (i = 0; i < NX; i++) {
                s.x[i] = NAN;
            }
#endif
            lost = 1;
        }
        fwrite(out, sizeof out, 1, stdout);
        fwrite(o.drive, sizeof o.drive, 1, stdout);
        fwrite(o.displacement, sizeof o.displacement, 1, stdout);
#ifdef STATES
        fwrite(o.state, sizeof o.state, 1, stdout);
#endif
#if NX > 0
        fwrite(s.x, sizeof s.x, 1, stdout);
#endif
        fwrite(s.z, sizeof s.z, 1, stdout);
#if NU > 0
        fwrite(s.u, sizeof s.u, 1, stdout);
#endif
        if (lost) { /* it stays so until it is initialised */
            memcpy(s.z, in + 1 + NX, sizeof s.z);
            if (limiter_settle(&s, in + 1 + NX + N, &o) != LIMITER_LOST) {
                return 2;
            }
            limiter_init(&s);
        }
    }
    return 0;
}
"""


def run_c(device: Device, controller: Controller, records: np.ndarray, folder: Path) -> np.ndarray:
    """The answers of the generated C, built so that its branches are counted."""
    context = online_context(NOWHERE, controller, Real.DOUBLE, "limiter")
    for end in ("h", "c"):
        write(f"online.{end}", context, folder / f"limiter.{end}")
    (folder / "main.c").write_text(MAIN)
    defined = (
        [f"-DN={N}", f"-DNX={device.n_x}", f"-DNU={N * device.rated}"]
        + ["-DMOVING"] * device.moving
        + ["-DSTATES"] * device.states
    )
    strict = [flag for flag in FLAGS if flag != "-O2"]
    for words in (
        ["gcc", *strict, "--coverage", "-O0", "-c", "limiter.c"],
        ["gcc", "-std=c99", "-ffp-contract=off", *defined, "--coverage", "main.c", "limiter.o", "-o", "main"],
    ):
        done = subprocess.run(words, capture_output=True, text=True, cwd=folder)
        assert done.returncode == 0, done.stderr
    done = subprocess.run([folder / "main"], input=records.tobytes(), capture_output=True, cwd=folder)
    assert done.returncode == 0
    return np.frombuffer(done.stdout).reshape(len(records), -1)


def unvisited(folder: Path, kernels: set[str]) -> list[str]:
    """Branches and lines of the generated C, kernels left out, that no call took."""
    subprocess.run(
        ["gcov", "--json-format", "--branch-probabilities", "limiter.c"], cwd=folder, check=True, capture_output=True
    )
    (report,) = folder.glob("limiter*.gcov.json.gz")
    (file,) = (f for f in json.loads(gzip.decompress(report.read_bytes()))["files"] if f["file"].endswith("limiter.c"))
    text = (folder / "limiter.c").read_text().splitlines()
    return [
        f"{line['line_number']}: {text[line['line_number'] - 1].strip()}"
        for line in file["lines"]
        if line.get("function_name") not in kernels
        and (line["count"] == 0 or any(branch["count"] == 0 for branch in line["branches"]))
    ]


def check_status(met: tuple[str, ...], calls: list, status: ControllerStatus) -> None:
    """The status says what the decisions amount to; beside RATE there may be more."""
    _, displacement, state, share, drive = met
    expected = ControllerStatus.DISPLACEMENT if displacement == "beyond" else ControllerStatus(0)
    expected |= ControllerStatus.STATE if state == "beyond" else ControllerStatus(0)
    expected |= ControllerStatus.DRIVE if drive not in ("inside", "edge") else ControllerStatus(0)
    if ControllerStatus.RATE in status:
        assert expected & ~status == 0, met
        return
    assert status & ~ControllerStatus.COMPOSITE == expected, met
    assert bool(status & ControllerStatus.COMPOSITE) == (share == "over" or grows(calls)), met


@pytest.mark.long
@pytest.mark.parametrize(
    "device",
    [pytest.param(d, marks=pytest.mark.long) if d.rated or d.rounds > 1 or d == Device() else d for d in DEVICES],
    ids=str,
)
def test_limiter_in_c_and_in_python_agree_on_every_combination_of_branches(device, tmp_path):
    for program in ("gcc", "gcov"):
        if not shutil.which(program):
            pytest.skip(f"{program} is missing: the branches of the generated limiter were not counted")
    controller = scripted(device)
    calls: list = []
    observed = replace(controller, observe=lambda what, answered: calls.append((what, answered)))
    rng = np.random.default_rng(14)
    missing, records, answers, growing = device.combinations(), [], [], set()

    def ask(mode, x, z, target, *last):
        with np.errstate(invalid="ignore"):
            last = list(last) or last_drive(rng, controller, (mode, x, z, target))
            calls.clear()
            step = observed.step((x, z, *last), target, settle=mode == "settle")
        records.append(np.concatenate([[float(mode == "step")], x, z, target, *last]))
        answers.append(answer(step))
        return step

    for wish in sorted(missing):
        for _ in range(PATIENCE if wish in missing else 0):
            step = ask(wish[0], *sample(rng, device, wish))
            met = combination(device, wish[0], calls)
            assert met in device.combinations()
            check_status(met, calls, step.status)
            rare = (met[-1] in TRIALS and drives(calls)[1] == "edge") or grows(calls)
            growing.update([wish[0]] if grows(calls) else [])
            if met not in missing and not rare:
                records.pop(), answers.pop()
            missing.discard(met)
            if wish not in missing:
                break
    assert not missing, (len(missing), sorted(missing)[:10])
    assert device.rounds == 1 or growing == {mode for mode, *_ in device.combinations()}
    for case in [*odd_cases(rng, device), *(spoilt_drives(rng, device) if device.rated else [])]:
        ask(*case)
    answers, printed = np.array(answers), run_c(device, controller, np.array(records), tmp_path)
    same = (answers == printed) | (np.isnan(answers) & np.isnan(printed))
    wrong = np.flatnonzero(~same.all(axis=1))
    assert not wrong.size, (len(wrong), len(records), records[wrong[0]], answers[wrong[0]], printed[wrong[0]])
    context = online_context(NOWHERE, controller, Real.DOUBLE, "limiter")
    physics = {kernel.name for kernel in context["kernels"]} | {"whole_below", "square_root"}
    assert not unvisited(tmp_path, {f"limiter_{name}" for name in physics})


@pytest.mark.long
def test_samples_of_these_devices_take_every_branch_of_the_limiter_in_python(tmp_path):
    measured = coverage.Coverage(branch=True, include=[feedforward.__file__], data_file=None)
    rng = np.random.default_rng(15)
    with measured.collect():
        for device in DEVICES:
            controller = scripted(device)
            for wish in sorted(device.combinations()):
                x, z, target = sample(rng, device, wish)
                last = last_drive(rng, controller, (wish[0], x, z, target))
                controller.step((x, z, *last), target, settle=wish[0] == "settle")
            for mode, x, z, target, *last in [*odd_cases(rng, device), *spoilt_drives(rng, device) * device.rated]:
                with np.errstate(invalid="ignore"):
                    last = last or last_drive(rng, controller, (mode, x, z, target))
                    controller.step((x, z, *last[: device.rated]), target, settle=mode == "settle")
    measured.json_report(outfile=str(tmp_path / "report.json"))
    (report,) = json.loads((tmp_path / "report.json").read_text())["files"].values()
    entered = {name: found for name, found in report["functions"].items() if name and found["executed_lines"]}
    assert "Controller.step" in entered
    assert {name: found["missing_branches"] for name, found in entered.items() if found["missing_branches"]} == {}
    assert {name: found["missing_lines"] for name, found in entered.items() if found["missing_lines"]} == {}
