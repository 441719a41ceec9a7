"""Search for an inverse and a damping: settings of a control law, tried on perturbed scenarios.

`space` defines the tunable keys and their bounds, `perturbed` draws the perturbed scenarios, `trials` runs
settings on them and measures the results, `front` sorts the results, `search` decides what to try next,
`verdict` picks the best, and `tune` combines all of this.
"""
