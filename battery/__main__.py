"""`python -m battery make|score`: draw concealed cases, run the diagnosis over them, print the table."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from battery import cases, score

EXAMPLE = """\
  python -m battery make --out out/battery --seed 7
  python -m battery score out/battery --run "ctrlgen diagnose"

A case takes some 20 s; what was stopped goes on with the cases that are left."""
SIZES = ", ".join(f"{name}: {sum(counts)} cases" for name, counts in cases.COUNTS.items())


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    )


def classes_of(text: str) -> tuple[str, ...]:
    """The classes named, between commas; all for an empty text."""
    names = tuple(filter(None, text.split(",")))
    for name in names:
        if name not in cases.CLASSES:
            raise argparse.ArgumentTypeError(f"{name!r} is no class; known are {', '.join(cases.CLASSES)}")
    return names or cases.CLASSES


def main(arguments: list[str] | None = None) -> int:
    """Exit 0 when the table was made, whatever it says; --strict: 1 where a goal is missed."""
    parser = argparse.ArgumentParser(
        prog="python -m battery",
        description=__doc__,
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="draw cases into a folder, answers sealed")
    make.add_argument("--out", type=Path, required=True, help="gets cases/ and answers/")
    make.add_argument("--seed", type=int, default=1, help="of everything drawn; a seed not seen before proves most")
    make.add_argument("--size", choices=sorted(cases.COUNTS), default="small", help=SIZES)
    make.add_argument(
        "--classes",
        type=classes_of,
        default=cases.CLASSES,
        metavar="A,B",
        help=f"only these of {', '.join(cases.CLASSES)}",
    )
    run = commands.add_parser("score", help="run the diagnosis over a folder and print the table")
    run.add_argument("folder", type=Path, help="what make left")
    run.add_argument("--run", default="ctrlgen diagnose", help="the command under test")
    run.add_argument("--timeout", type=float, default=600.0, help="seconds a case may take")
    run.add_argument("--opponents", type=int, default=0, metavar="N", help="opponents on N cases of each class")
    run.add_argument("--again", action="store_true", help="run cases that already have a diagnosis again")
    run.add_argument("--strict", action="store_true", help="exit 1 where a goal is missed")
    for each in (make, run):
        each.add_argument("--jobs", type=int, default=2, help="cases at a time")
    a = parser.parse_args(arguments)
    console = Console()
    with _progress(console) as bar:
        task = bar.add_task("drawing" if a.command == "make" else "diagnosing", total=None)

        def shown(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        if a.command == "make":
            cases.make(a.out, a.seed, a.size, a.jobs, shown, a.classes)
            return 0
        result = score.run(a.folder, shlex.split(a.run), a.jobs, a.timeout, a.again, a.opponents, shown)
    console.print(result.markdown, markup=False, highlight=False)
    return int(a.strict and not result.met)


if __name__ == "__main__":
    raise SystemExit(main())
