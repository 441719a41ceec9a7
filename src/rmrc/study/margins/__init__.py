"""Stability margins: how much more delay, lag and gain the loop of a scenario tolerates.

`ringing` runs a world and its twin with a briefly displaced reference, and judges whether their difference
keeps ringing; `margins` does so for many settings and finds the stability limits; `report` shows the results.
"""
