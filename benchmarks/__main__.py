"""All benchmarks that need no data: `python -m benchmarks`.

python -m benchmarks                        run all, write JSON and draw the plots
python -m benchmarks run latency roofline   run some
python -m benchmarks goals FILE             the goals, and which a run met
python -m benchmarks compare BEFORE AFTER   what became worse; exits 1 if anything did
python -m benchmarks list                   all there are, with those that need data
"""

import argparse
import sys
from pathlib import Path

from benchmarks import comparison, plots, suite
from benchmarks.figures import line
from meshconv3d.export.metadata import ModelFileError
from meshconv3d.service.models import DEFAULT_MODEL

RESULT = suite.ROOT / "benchmarks" / "results" / "performance.json"
IMAGES = suite.ROOT / "docs" / "images"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="run benchmarks, write JSON, draw plots")
    run.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(suite.BENCHMARKS)}")
    run.add_argument("--model", default=DEFAULT_MODEL, help="shipped model or model file")
    run.add_argument("--out", type=Path, help=f"JSON file; of a run of all, {RESULT.name}")
    goals = commands.add_parser("goals", help="which goals a run met")
    goals.add_argument("file", type=Path, nargs="?", default=RESULT)
    compare = commands.add_parser("compare", help="exits 1 where something became worse")
    compare.add_argument("before", type=Path)
    compare.add_argument("after", type=Path)
    compare.add_argument("--tolerance", type=float, default=0.2, help="share; 0.2 unless told")
    commands.add_parser("list", help="all benchmarks")
    arguments = parser.parse_args(sys.argv[1:] or ["run"])
    try:
        code = COMMANDS[arguments.command](arguments)
    except (ValueError, OSError, ModelFileError) as error:
        parser.error(str(error))
    sys.exit(code)


def run(arguments: argparse.Namespace) -> int:
    unknown = set(arguments.names) - set(suite.BENCHMARKS)
    if unknown:
        raise ValueError(f"no benchmark {', '.join(sorted(unknown))}; see `list`")
    done = suite.run(arguments.names or suite.BENCHMARKS, arguments.model)
    if arguments.out:
        done.write(arguments.out)
    elif not arguments.names:
        done.write(RESULT)
        plots.draw(done, IMAGES)
    return 0


def goals(arguments: argparse.Namespace) -> int:
    done = suite.Run.read(arguments.file)
    for name, findings in done.findings.items():
        print(name)
        for title, figure in findings.figures.items():
            if figure.goal is not None:
                print(line(title, figure))
    return 0


def compare(arguments: argparse.Namespace) -> int:
    runs = suite.Run.read(arguments.before), suite.Run.read(arguments.after)
    return 0 if comparison.compare(*runs, arguments.tolerance) else 1


def show_list(arguments: argparse.Namespace) -> int:
    print("Run by `python -m benchmarks`:")
    print("\n".join(f"  {name}" for name in suite.BENCHMARKS))
    print("Each by itself, all but batch with data, `python -m benchmarks.NAME DATA`:")
    print("\n".join(f"  {name}" for name in suite.BY_THEMSELVES))
    return 0


COMMANDS = {"run": run, "goals": goals, "compare": compare, "list": show_list}

if __name__ == "__main__":
    main()
