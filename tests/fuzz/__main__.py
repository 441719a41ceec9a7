"""The command line: `run` and `replay` hostile inputs."""

import argparse
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz.inputs import CLASSES, case
from fuzz.worker import answers


def main(argv=None):
    """Return the exit code: 0 if nothing is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    run = verbs.add_parser("run", help="run inputs, and print what is wrong")
    run.add_argument("--count", type=int, default=1000, help="how many inputs (default: 1000)")
    run.add_argument("--jobs", type=int, default=2, help="workers at a time (default: 2)")
    run.add_argument("--failures", type=Path, help="folder for the inputs that failed, a file each")
    replay = verbs.add_parser("replay", help="run an input once, and print it and what came of it")
    replay.add_argument("name", metavar="CLASS", help=f"{', '.join(CLASSES)}, or file")
    replay.add_argument("index", metavar="INDEX", help="a number, or the path of a file of --failures")
    options = parser.parse_args(argv)
    if options.verb == "replay":
        index = options.index if options.name == "file" else int(options.index)
        (answer,) = answers([(options.name, index)])
        print(
            case(options.name, index).text(),
            f"exit code {answer.code}",
            repr(answer.out),
            repr(answer.err),
            sep="\n",
        )
        return told(answer)
    classes = list(CLASSES)
    names = [(classes[i % len(classes)], i // len(classes)) for i in range(options.count)]
    collected = answers(names, options.jobs)
    for answer in collected:
        if told(answer) and options.failures:
            options.failures.mkdir(parents=True, exist_ok=True)
            path = options.failures / f"{answer.name}-{answer.index}.json"
            path.write_text(case(answer.name, answer.index).text(found=answer.faults), "utf-8")
    for (name, code), count in sorted(Counter((answer.name, answer.code) for answer in collected).items()):
        print(f"{name:10} exit code {code:4}{count:8}")
    return int(any(answer.faults for answer in collected))


def told(answer):
    """Print the faults of an answer, and return whether there are any."""
    for fault, text in answer.faults:
        print(f"{answer.name} {answer.index}: {fault}: {text}")
    return bool(answer.faults)


if __name__ == "__main__":
    sys.exit(main())
