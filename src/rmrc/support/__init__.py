"""Shared basics: rotations, errors, files, threads, signals, and the machine's limits."""
