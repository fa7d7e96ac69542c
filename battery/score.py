"""Runs the program under test over a folder of cases, opens the answers, and makes the goals table of DIAGNOSIS.md."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from battery.consistency import contradictions
from battery.judge import Judgement, judge
from battery.rows import Row, number, share
from battery.score_further import evidence_table, further_rows
from battery.score_rough import rough_rows
from battery.seal import unseal

POLL = 0.05  # s, between looks whether a process has ended
NULLS = {"clean", "hexapod_clean", "null"}


@dataclass(frozen=True)
class Result:
    """The table as `markdown`, whether every goal that had a case is `met`, and all as `data`."""

    markdown: str
    met: bool
    data: dict[str, Any]


def run_case(folder: Path, name: str, command: Sequence[str], timeout: float, again: bool) -> dict[str, Any]:
    """The command on one case; {'seconds', 'cpu' [s], 'memory' [GB], 'exit'}, kept in results/<case>/run.json so that an interrupted run
    goes on."""
    case, out = folder / "cases" / name, folder / "results" / name
    kept = out / "run.json"
    if kept.exists() and not again:
        return json.loads(kept.read_text())
    out.mkdir(parents=True, exist_ok=True)
    (out / "report" / "diagnosis.json").unlink(missing_ok=True)
    begin = time.perf_counter()
    with (out / "log.txt").open("w") as log:
        files = [str(case / "device.toml"), str(case / "recording.toml"), "--out", str(out / "report")]
        process = subprocess.Popen([*command, *files], stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        code, usage = _finished(process, begin + timeout)
    state: dict[str, Any] = {"seconds": time.perf_counter() - begin, "exit": code}
    state |= {"cpu": usage.ru_utime + usage.ru_stime, "memory": usage.ru_maxrss / 1e6}
    kept.write_text(json.dumps(state) + "\n")
    return state


def _finished(process: subprocess.Popen[bytes], until: float) -> tuple[int | str, resource.struct_rusage]:
    """How the process ended, 'time-out' at `until`, and what it and its children used: the largest memory of one of them."""
    code: int | str | None = None
    while True:
        pid, status, usage = os.wait4(process.pid, 0 if code else os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode if code is None else code, usage
        if time.perf_counter() > until:
            os.killpg(process.pid, signal.SIGKILL)  # the command's own children too: it leads its own session
            code = "time-out"
        else:
            time.sleep(POLL)


def load(folder: Path, name: str, state: dict[str, Any]) -> Judgement:
    """The judgement of one case that was run."""
    answer = unseal(folder / "answers" / f"{name}.json")
    path = folder / "results" / name / "report" / "diagnosis.json"
    diagnosis = None
    if state["exit"] == 0 and path.exists():
        try:
            diagnosis = json.loads(path.read_text())
        except json.JSONDecodeError:
            diagnosis = None
    judged = judge(answer, diagnosis, state["seconds"])
    judged.cpu, judged.memory = state.get("cpu"), state.get("memory")
    judged.contradictions = contradictions(diagnosis) if diagnosis else []
    return judged


def table(judged: Sequence[Judgement]) -> list[Row]:
    """The rows of the goals table of DIAGNOSIS.md."""

    def of(*kinds: str) -> list[Judgement]:
        return [j for j in judged if j.kind in kinds]

    single = of("single", "hexapod_single")
    smooth = [j for j in judged if j.rough is None]
    places = [p for j in smooth for p in j.places]
    covered = [c for j in smooth for c in j.covered]
    colour = [c for j in smooth if j.autocorrelated for c in j.covered]
    known = of("single", "multiple", "hexapod_single")
    ratios = [j.ratio for j in known if j.verdict != "failed" and j.ratio is not None]  # some noise nobody can know
    return [
        share("false alarms on clean records", [j.alarmed for j in of("clean", "hexapod_clean")], "<= 2 %", most=0.02),
        share("single >= 1 x noise, named exactly or in a set of two", [j.in_set for j in single], ">= 95 %", 0.95),
        share("single >= 1 x noise, exactly", [j.exact for j in single], ">= 85 %", 0.85),
        share("single 0.3-1 x noise, named", [j.in_set for j in of("weak")], ">= 70 %", 0.70),
        share("single 0.3-1 x noise, wrong name", [j.wrong for j in of("weak")], "<= 3 %", most=0.03),
        share("two or three, all exact", [j.exact for j in of("multiple")], ">= 80 %", 0.80),
        share("two or three, wrong name", [j.wrong for j in of("multiple")], "<= 5 %", most=0.05),
        share("outside the library, 'unexplained'", [j.abstained for j in of("outside")], ">= 95 %", 0.95),
        share("location, output or actuator", [c for c, _ in places], ">= 95 %", 0.95),
        share("location, place", [p for _, p in places], ">= 85 %", 0.85),
        share("location, band of a line", [b for j in smooth for b in j.bands], ">= 85 %", 0.85),
        share("coverage of 95 % intervals", [c.inside for c in covered], "90-98 %", 0.90, 0.98),
        share("coverage, autocorrelated noise", [c.inside for c in colour], "90-98 %", 0.90, 0.98),
        number("held-out error / floor, median", ratios, 0.5, "<= 1.05", 1.05),
        number("held-out error / floor, 95th percentile", ratios, 0.95, "<= 1.3", 1.3),
        number(
            "time of a case with one effect, longest [s]", [j.seconds for j in single if j.seconds], 1.0, "<= 60", 60
        ),
        number(
            "time of a case with two or three, longest [s]",
            [j.seconds for j in of("multiple") if j.seconds],
            1.0,
            "<= 180",
            180,
        ),
        share(
            "confusable, said to be so with the truth in the set", [j.admitted for j in of("confusable")], "none set"
        ),
        share("confusable, wrong name", [j.wrong for j in of("confusable")], "none set"),
        *rough_rows(judged),
        *further_rows(judged),
        *luck_rows(judged),
        share("contradicts itself", [bool(j.contradictions) for j in judged], "0 %", most=0.0),
        share("crashed, refused or out of time", [j.verdict == "failed" for j in judged], "0 %", most=0.0),
    ]


LEVEL = 0.05  # chance by luck up to which a finding is told without a word of doubt


def luck_rows(judged: Sequence[Judgement]) -> list[Row]:
    """Whether the stated chance of a finding by luck holds where nothing is wrong, and whom it doubts elsewhere."""
    nulls = [j for j in judged if j.kind in NULLS]
    there, not_there = (
        [_certain(p) for j in judged for right, p in j.luck if right is wanted] for wanted in (True, False)
    )
    return [
        share(
            "nulls, certified though not there",
            [any(_certain(p) for right, p in j.luck if not right) for j in nulls],
            "<= 5 %",
            most=LEVEL,
        ),
        share("findings that are there, certified", there, "none set"),
        share("findings that are not there, certified (not luck, but another law)", not_there, "none set"),
    ]


def _certain(by_luck: float | None) -> bool:
    return by_luck is not None and by_luck <= LEVEL


def confusion(judged: Sequence[Judgement]) -> Counter[tuple[str, str]]:
    """How often each planted law got each name; ('nothing', x) are names given for nothing planted."""
    pairs = Counter(pair for j in judged for pair in j.named)
    quiet = sum(1 for j in judged if j.kind in NULLS and not j.named)
    return pairs + Counter({("nothing", "none"): quiet})


def markdown(rows: Sequence[Row], judged: Sequence[Judgement], opponents: list[dict[str, Any]]) -> str:
    """Goals, verdicts by class, confusion, opponents."""
    word = {True: "yes", False: "NO", None: "-"}
    lines = ["| figure | measured [95 % interval] | goal | met |", "|---|---|---|---|"]
    lines += [f"| {r.what} | {r.shown} | {r.goal} | {word[r.met] if r.goal != 'none set' else '-'} |" for r in rows]
    lines += ["", "| class | cases | verdicts |", "|---|---|---|"]
    for kind in sorted({j.kind for j in judged}):
        verdicts = Counter(j.verdict for j in judged if j.kind == kind)
        lines.append(f"| {kind} | {verdicts.total()} | {', '.join(f'{v} {n}' for v, n in verdicts.most_common())} |")
    lines += ["", "| planted | named |", "|---|---|"]
    pairs = confusion(judged)
    for truth in sorted({t for t, _ in pairs}):
        named = Counter({n: c for (t, n), c in pairs.items() if t == truth})
        lines.append(f"| {truth} | {', '.join(f'{n} {c}' for n, c in named.most_common())} |")
    lines += ["", *evidence_table(judged)]
    if opponents:
        from battery.opponents import summary

        lines += ["", *summary(opponents, judged)]
    return "\n".join(lines) + "\n"


def figure(path: Path, judged: Sequence[Judgement]) -> None:
    """The confusion matrix as a picture, rows planted, columns named, shares of a row."""
    from matplotlib.figure import Figure

    pairs = confusion(judged)
    rows = sorted({t for t, _ in pairs}, key=lambda t: (t == "nothing", t))
    columns = sorted(
        {n for _, n in pairs}, key=lambda n: (n in {"none", "failed"}, rows.index(n) if n in rows else 99, n)
    )
    M = np.array([[pairs[t, n] for n in columns] for t in rows], dtype=float)
    fig = Figure(figsize=(2.5 + 0.28 * len(columns), 2 + 0.26 * len(rows)), layout="constrained")
    ax = fig.subplots()
    ax.imshow(M / np.maximum(M.sum(axis=1, keepdims=True), 1), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    ax.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    ax.set_yticks(range(len(rows)), rows, fontsize=7)
    for (i, k), count in np.ndenumerate(M):
        if count:
            ax.text(
                k,
                i,
                f"{count:.0f}",
                ha="center",
                va="center",
                fontsize=6,
                color="white" if count > M[i].sum() / 2 else "black",
            )
    ax.set_xlabel("named"), ax.set_ylabel("planted")
    fig.savefig(path, dpi=150)


def run(
    folder: Path,
    command: Sequence[str],
    jobs: int = 2,
    timeout: float = 600.0,
    again: bool = False,
    opponents: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Diagnose all cases, judge, and write table.md, table.json, confusion.png into `folder`."""
    names = sorted(p.name for p in (folder / "cases").iterdir())
    states: dict[str, Any] = {}
    with ThreadPoolExecutor(jobs) as pool:  # each thread only waits for its process
        waiting = {pool.submit(run_case, folder, name, command, timeout, again): name for name in names}
        for done, future in enumerate(as_completed(waiting), 1):
            states[waiting[future]] = future.result()
            if progress:
                progress(done, len(names))
    judged = [load(folder, name, states[name]) for name in names]
    others: list[dict[str, Any]] = []
    if opponents:
        from battery.opponents import run_all

        others = run_all(folder, judged, opponents, jobs)
    return write(folder, judged, others)


def write(folder: Path, judged: Sequence[Judgement], opponents: list[dict[str, Any]]) -> Result:
    """table.md, table.json, confusion.png."""
    rows = table(judged)
    text = markdown(rows, judged, opponents)
    data = {
        "goals": [{**vars(r), "shown": r.shown} for r in rows],
        "cases": [asdict(j) for j in judged],
        "opponents": opponents,
    }
    (folder / "table.md").write_text(text)
    (folder / "table.json").write_text(json.dumps(data, indent=1) + "\n")
    figure(folder / "confusion.png", judged)
    return Result(text, all(r.met is not False for r in rows if r.goal != "none set"), data)
