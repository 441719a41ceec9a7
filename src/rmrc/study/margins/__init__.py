"""How much more delay, lag and gain the loop of a scenario bears before it is unstable.

`kicks` makes a twin of a world, whose reference is moved for moments; `ringing` runs both and says whether
the difference rings on; `search` does so for many settings and finds the edge; `margins` asks for a scenario,
and `report` and `figure` show what was found.
"""
