"""Resolved motion rate control in MuJoCo."""

__version__ = "0.1.0"
