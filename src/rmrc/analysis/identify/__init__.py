"""Delay, lag and noise of an arm from a log of its commands and positions."""
