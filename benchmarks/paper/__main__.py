"""The paper's tables: `python -m benchmarks.paper`.

python -m benchmarks.paper                             what was measured, beside the paper's figures
python -m benchmarks.paper shrec11 DATA/shrec_16       Table I: train and score
python -m benchmarks.paper cubes DATA/cubes            Table I, of `python -m benchmarks.cubes`
python -m benchmarks.paper manifold40 DATA/Manifold40  Table II
python -m benchmarks.paper modelnet40 DATA/ModelNet40  Table II
python -m benchmarks.paper cost DATA/shrec_16          Table III: run time and memory
"""

import argparse
from pathlib import Path

from benchmarks.paper import accuracy, cost, tables


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", metavar="TABLE")
    for name in (*accuracy.PROTOCOLS, "cost"):
        command = commands.add_parser(name)
        command.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*")
        if name != "cost":
            command.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
            command.add_argument("--out", type=Path, default=Path("runs"), help="for the runs")
    arguments = parser.parse_args()
    if arguments.command == "cost":
        cost.measure(arguments.data)
    elif arguments.command:
        protocols = accuracy.PROTOCOLS[arguments.command]
        accuracy.measure(protocols, arguments.data, arguments.out, arguments.seeds)
    print("\n\n".join(tables.all_tables()))


if __name__ == "__main__":
    main()
