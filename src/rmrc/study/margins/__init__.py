"""Stability margins: how much more delay, lag and gain the loop of a scenario tolerates.

`kicks` makes a twin of a world with a briefly displaced reference; `ringing` runs both and judges whether
their difference keeps ringing; `search` does so for many settings and finds the stability limit; `margins`
does so for a scenario, and `report` and `figure` show the results.
"""
