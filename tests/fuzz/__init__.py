"""Hostile inputs for the command line: made from (class, index) alone, run under a supervisor, judged.

    python -m tests.fuzz run --count 1000         run inputs of all classes; exit code 1 if anything was found
    python -m tests.fuzz show models 17           print an input
    python -m tests.fuzz replay models 17         run it once, in a process of its own, and print what came of it

`chance` decides, `models`, `scenarios`, `options` and `numbers` make inputs, `sandbox` runs one in this process,
`judge` says what is wrong with what came of it, `worker` runs one after the other, and `supervisor` watches
workers: their time, their memory, their deaths. `planted` has faults that all of it must find.
"""
