"""Command line of the benchmarks."""

from __future__ import annotations

import argparse
import sys

from benchmarks import budget, diagnosis, job, long_recording, mechanism, online, target, topp, trajectory
from benchmarks.measure import Count, Line, Note, print_table
from benchmarks.samples import Disagreement

BENCHMARKS = {
    "trajectory": trajectory,
    "online": online,
    "target": target,
    "job": job,
    "mechanism": mechanism,
    "topp": topp,
    "budget": budget,
    "diagnosis": diagnosis,
    "long_recording": long_recording,
}


def main() -> int:
    """Runs the named benchmarks, or all; 1 when a contender's answers are wrong."""
    about = "\n".join(f"  {name:12}{(module.__doc__ or '').strip()}" for name, module in BENCHMARKS.items())
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Times ctrlgen against named peers in the same run. Every answer is checked before it is timed.",
        epilog=f"benchmarks:\n{about}\n\n"
        "Contenders take turns, N rounds. ratio = median of ours / median of the peer's (below 1: ours is faster);\n"
        "'rounds' is the smallest and largest ratio of a single round: where it is wide, the machine was busy.\n\n"
        "examples:\n  python -m benchmarks\n  python -m benchmarks online --repeat 9",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(BENCHMARKS)} (default: all)")
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="rounds, from 1 (default: 5)")
    arguments = parser.parse_args()
    if arguments.repeat < 1:
        parser.error("--repeat must be 1 or more")
    for name in arguments.names:
        if name not in BENCHMARKS:
            parser.error(f"no benchmark {name!r}; there are {', '.join(BENCHMARKS)}")
    results: list[Line | Count | Note] = []
    try:
        for name in dict.fromkeys(arguments.names or BENCHMARKS):
            print(f"{name} ...", file=sys.stderr, flush=True)
            results += BENCHMARKS[name].run(arguments.repeat)
    except Disagreement as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    print_table(results)
    return 0


if __name__ == "__main__":
    sys.exit(main())
