"""`python -m mutants`: puts a seeded sample of wrong lines into ctrlgen, one at a time, and counts how many the tests catch."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from queue import Queue

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from mutants.areas import AREAS, files
from mutants.draw import Mutant, drawn
from mutants.seen import Seen, code_hash, seen
from mutants.trial import CAUGHT, SURVIVED, TIMEOUT, UNSEEN, Copy, Outcome

ROOT = Path(__file__).resolve().parent.parent
FOUND = (CAUGHT, TIMEOUT)
EXAMPLE = """\
  python -m mutants --sample 100 --seed 1 --out out/mutants
  python -m mutants --sample 12 --tests test_law_values test_thresholds --covered

The first run after a change of code measures which test executes which line (as long as the tests take, twice over); survivors are
argued in docs/mutants.md."""


def main(arguments: list[str] | None = None) -> int:
    """Exit 1 where fewer than --least of the mutants were caught."""
    parser = argparse.ArgumentParser(
        prog="python -m mutants",
        description=__doc__,
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--sample", type=int, default=100, help="mutants, as many of each area")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument(
        "--limit", type=float, default=240.0, help="seconds a mutant may take; its tests take a quarter at most"
    )
    parser.add_argument("--jobs", type=int, default=2, help="mutants, and files of tests, at a time")
    parser.add_argument(
        "--out", type=Path, default=Path("out/mutants"), help="gets mutants.json and the cache of lines seen"
    )
    parser.add_argument("--areas", nargs="+", choices=AREAS, default=list(AREAS), help="default: all")
    parser.add_argument(
        "--tests", nargs="+", metavar="FILE", help="these files of tests alone, such as test_law_values"
    )
    parser.add_argument("--covered", action="store_true", help="draw among lines that these tests can see alone")
    parser.add_argument("--least", type=float, default=0.9, help="share that must be caught")
    a = parser.parse_args(arguments)
    console = Console()
    tests = sorted((ROOT / "tests").glob("test_*.py"))
    if a.tests:
        missing = set(a.tests) - {path.stem for path in tests}
        if missing:
            parser.error(f"no such file of tests: {', '.join(sorted(missing))}")
        tests = [path for path in tests if path.stem in a.tests]
    a.out.mkdir(parents=True, exist_ok=True)
    with _progress(console) as bar:
        task = bar.add_task("lines seen", total=len(tests))
        known = seen(ROOT, tests, a.out.resolve() / "seen", a.jobs, lambda: bar.advance(task))
        chosen = drawn(
            ROOT, {area: files(ROOT, area) for area in a.areas}, a.sample, a.seed, known if a.covered else None
        )
        task = bar.add_task("mutants", total=len(chosen))
        outcomes: list[Outcome] = []

        def tried(outcome: Outcome) -> None:
            bar.advance(task)
            outcomes.append(outcome)
            if outcome.what not in FOUND:
                console.print(f"{outcome.what} ({outcome.tests} tests, {outcome.left} left out)", style="bold")
                console.print(outcome.diff, markup=False, highlight=False, soft_wrap=True)
            # A run that is stopped has said something
            _write(a.out / "mutants.json", a.sample, a.seed, outcomes)

        _try(chosen, known, a.limit, a.jobs, tried)
    share = _share(outcomes)
    _show(console, outcomes)
    console.print(f"{a.out / 'mutants.json'}: {share:.0%} caught of {len(outcomes)}")
    return 0 if share >= a.least else 1


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    )


def _try(chosen: list[Mutant], known: Seen, limit: float, jobs: int, tried: Callable[[Outcome], None]) -> None:
    copies: Queue[Copy] = Queue()
    for _ in range(jobs):
        copies.put(Copy(ROOT))

    def one(mutant: Mutant) -> Outcome:
        copy = copies.get()
        try:
            return copy.tried(mutant, known.tests(mutant.file, mutant.line), known.seconds, limit)
        finally:
            copies.put(copy)

    try:
        with ThreadPoolExecutor(jobs) as pool:
            for running in as_completed([pool.submit(one, mutant) for mutant in chosen]):
                tried(running.result())
    finally:
        for _ in range(jobs):
            copies.get().remove()


def _share(outcomes: list[Outcome]) -> float:
    return sum(o.what in FOUND for o in outcomes) / max(len(outcomes), 1)


def _write(path: Path, sample: int, seed: int, outcomes: list[Outcome]) -> None:
    rows = [asdict(o.mutant) | {k: v for k, v in asdict(o).items() if k != "mutant"} for o in outcomes]
    rows.sort(key=lambda row: (row["what"] in FOUND, row["file"], row["line"]))
    report = {"sample": sample, "seed": seed, "code": code_hash(ROOT), "caught": _share(outcomes), "mutants": rows}
    path.write_text(json.dumps(report, indent=1))


def _show(console: Console, outcomes: list[Outcome]) -> None:
    """The table by area."""
    table = Table("area", CAUGHT, TIMEOUT, SURVIVED, UNSEEN, "of", title="mutants")
    for area in AREAS:
        counts = Counter(o.what for o in outcomes if o.mutant.area == area)
        if counts:
            table.add_row(
                area, *(str(counts[what]) for what in (CAUGHT, TIMEOUT, SURVIVED, UNSEEN)), str(counts.total())
            )
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
