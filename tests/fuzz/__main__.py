"""The command line: `run`, `show` and `replay` inputs."""

import argparse
import itertools
import os
import sys
import tempfile
import time
from pathlib import Path

from . import case as cases
from . import classes
from .supervisor import Bounds, supervise


def main(argv=None):
    """Return the exit code: 0 if nothing was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    run = verbs.add_parser("run", help="run inputs, and say what was found")
    run.add_argument("--count", type=int, default=1000, help="how many inputs (default: 1000)")
    run.add_argument("--jobs", type=int, default=2, help="workers at a time (default: 2)")
    run.add_argument(
        "--minutes", type=float, help="begin no input after so many; what is missing then is told"
    )
    run.add_argument(
        "--class", dest="kind", choices=list(classes.GENERATORS), help="inputs of this class only"
    )
    run.add_argument("--seed-offset", type=int, default=0, help="begin at another index than 0")
    run.add_argument("--failures", type=Path, help="folder for the inputs that failed, a file each")
    run.add_argument("--frozen", action="store_true", help="run the inputs of tests/fuzz/regressions instead")
    for name, what in (
        ("show", "print an input"),
        ("replay", "run an input once, and print what came of it"),
    ):
        one = verbs.add_parser(name, help=what)
        one.add_argument("kind", metavar="CLASS", help=f"{', '.join(classes.GENERATORS)}, or file")
        one.add_argument(
            "index", metavar="INDEX", help="a number, or the path of a file that `show` or `run` wrote"
        )
        one.add_argument(
            "--into", type=Path, help="also write its files into this folder"
        ) if name == "show" else None
    asked = parser.parse_args(argv)
    return {"run": _run, "show": _show, "replay": _replay}[asked.verb](asked)


def _run(asked):
    if asked.frozen:
        inputs = [
            ("file", str(path)) for path in sorted((Path(__file__).parent / "regressions").glob("*.json"))
        ]
        asked.count = len(inputs)
    elif asked.kind:
        inputs = ((asked.kind, index) for index in range(asked.count))
    else:
        inputs = classes.mixed(asked.count)
    inputs = ((kind, index if kind == "file" else index + asked.seed_offset) for kind, index in inputs)
    until = None if asked.minutes is None else time.monotonic() + 60.0 * asked.minutes
    told = {"next": time.monotonic() + 60.0, "failures": 0}
    started = time.monotonic()

    def on_input(result):
        for failure in result.failures[told["failures"] :]:
            print(
                f"{failure.kind} {failure.index}: {failure.finding.kind}: {failure.finding.text}", flush=True
            )
            _keep(asked.failures, failure)
        told["failures"] = len(result.failures)
        if time.monotonic() > told["next"]:
            done, seconds = sum(result.counts.values()), time.monotonic() - started
            print(
                f"{seconds:.0f} s: {done} of {asked.count} inputs, {done / seconds:.1f} a second", flush=True
            )
            told["next"] = time.monotonic() + 60.0

    result = supervise(inputs, asked.jobs, Bounds(), until=until, on_input=on_input)
    _summarize(result)
    done = sum(result.counts.values())
    if done < asked.count:
        print(f"only {done} of {asked.count} inputs were run")
    return 1 if result.failures or done < asked.count else 0


def _summarize(result):
    kinds = result.kinds()
    columns = sorted(kinds) or ["findings"]
    if result.long:
        print(f"\n{result.long.total()} were long, and ended at Ctrl-C: {dict(result.long)}")
    print(
        f"\n{'class':12}{'inputs':>8}{'ms each':>9}"
        + "".join(f"{kind:>11}" for kind in columns)
        + "  exit codes"
    )
    for kind in sorted(result.counts):
        own = {(one.index, one.finding.kind) for one in result.failures if one.kind == kind}
        numbers = [sum(found == column for _, found in own) for column in columns]
        codes = ", ".join(f"{code}: {count}" for code, count in sorted(result.codes[kind].items()))
        each = 1000.0 * result.cpu[kind] / result.counts[kind]
        print(
            f"{kind:12}{result.counts[kind]:8}{each:9.1f}"
            + "".join(f"{number:11}" for number in numbers)
            + f"  {codes}"
        )
    total = sum(result.counts.values())
    print(
        f"{'all':12}{total:8}{1000.0 * result.cpu.total() / max(1, total):9.1f}"
        + "".join(f"{kinds[one]:11}" for one in columns)
    )
    print(f"{result.seconds:.0f} s, {total / max(1e-9, result.seconds):.1f} inputs a second")
    for cause, failures in result.causes().items():
        first = ", ".join(f"{one.kind} {one.index}" for one in itertools.islice(failures, 4))
        print(f"{len(failures):6}  {cause}\n        {first}")


def _keep(folder, failure):
    """Write an input that failed, so that it can be run again when generators have changed."""
    if folder is None or failure.kind == "file":
        return
    folder.mkdir(parents=True, exist_ok=True)
    text = classes.case(failure.kind, failure.index).text(
        origin=f"{failure.kind} {failure.index}", found=list(failure.finding)
    )
    (folder / f"{failure.kind}-{failure.index}.json").write_text(text, "utf-8")


def _case(asked):
    if asked.kind == "file":
        return cases.read(Path(asked.index).read_text("utf-8"))
    return classes.case(asked.kind, int(asked.index))


def _show(asked):
    case = _case(asked)
    if asked.into is not None:
        for path, data in case.files.items():
            place = asked.into / path
            place.parent.mkdir(parents=True, exist_ok=True)
            place.mkdir(exist_ok=True) if path.endswith("/") else place.write_bytes(data)
    print(case.text(origin=f"{asked.kind} {asked.index}"), end="")
    return 0


def _replay(asked):
    """Run one input in this process, with what it printed; then under a supervisor, which sees it hang."""
    result = supervise(
        [(asked.kind, str(Path(asked.index).resolve()) if asked.kind == "file" else int(asked.index))]
    )
    for failure in result.failures:
        print(f"{failure.finding.kind}: {failure.finding.text}")
    if not any(failure.finding.kind in ("hang", "memory", "death") for failure in result.failures):
        from .sandbox import Sandbox

        with tempfile.TemporaryDirectory(prefix="rmrc-fuzz-") as folder:
            from rmrc import cli

            outcome = Sandbox(Path(folder) / "sandbox", cli.main).run(_case(asked))
        print(
            f"exit code {outcome.code}, {outcome.seconds:.2f} s, files {outcome.files}, gone {outcome.gone}"
        )
        for name, data in (("stdout", outcome.out), ("stderr", outcome.err)):
            print(
                f"{name}: {data[:5000]!r}"
                if b"\x1b" in data
                else f"{name}:\n{data[:5000].decode('utf-8', 'replace')}"
            )
        print(outcome.error)
    print("nothing was found" if not result.failures else f"{len(result.failures)} findings")
    return 1 if result.failures else 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)
