"""Hostile inputs for the command line: robots, scenarios, options and numbers that nobody should write.

    python -m tests.fuzz run --count 1000         run inputs of all classes; exit code 1 if anything is wrong
    python -m tests.fuzz replay models 17         run one of them, and print it and what came of it

`inputs` makes them from a class and an index alone, and `worker` runs them in watched processes and judges what came
of them. Every input must end as a run, or as a documented error with a line that says why.
"""
