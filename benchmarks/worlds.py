"""How good the lines are on roads nobody tuned to: real surveys with hand-made references.

``python -m benchmarks.worlds --data DIR`` extracts each real survey with default settings and scores it within the
area of its reference (tests/references); DIR is ``shared/data`` beside the repository, or what the variable
LINEWORK_REAL_DATA names. ``--surveys av2,powerline-12an2-20`` takes some of them.
"""

import argparse

from benchmarks._real_worlds import checked_data, real_table, real_worlds
from linework.cli.commands.evaluate import print_tables

#: Minutes, and data that is not everywhere: run where it is asked for.
ON_REQUEST = True


def main(arguments=()):
    options = parsed(arguments)
    results = real_worlds(checked_data(options.data), tuple(filter(None, options.surveys.split(","))))
    print_tables([real_table(results)])


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds", description=__doc__)
    parser.add_argument("--data", default=None, help="folder of the real surveys")
    parser.add_argument("--surveys", default="", help="names of references, comma-separated; default: all")
    return parser.parse_args(list(arguments))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
