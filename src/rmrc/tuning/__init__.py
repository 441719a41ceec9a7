"""Which inverse and which damping: settings of a control law, tried on a scenario and on copies of it.

`space` says what can be chosen and between which bounds, `copies` draws the perturbed copies, `trials` has a
study run settings on them and measures what comes, `front` sorts what was measured, `search` decides what is
tried next, `verdict` says what is best, and `tune` is all of it from file to answer.
"""
