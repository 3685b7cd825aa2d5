"""The paper's tables: `python -m benchmarks.paper`.

python -m benchmarks.paper                         all that was measured, beside the paper's figures
python -m benchmarks.paper shrec11 DATA/shrec_16   Table I, SHREC11: train and score
"""

import argparse
from pathlib import Path

from benchmarks.paper import accuracy

DATA = {"shrec11": accuracy.SHREC11}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command")
    for name in DATA:
        command = commands.add_parser(name)
        command.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*")
        command.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
        command.add_argument("--out", type=Path, default=Path("runs"), help="folder for the runs")
    arguments = parser.parse_args()
    if arguments.command:
        protocols = DATA[arguments.command]
        accuracy.measure(protocols, arguments.data, arguments.out, arguments.seeds)


if __name__ == "__main__":
    main()
