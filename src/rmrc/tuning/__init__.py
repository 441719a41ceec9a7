"""Search for an inverse and a damping: settings of a control law, tried on perturbed scenarios.

`space` defines the tunable keys and their bounds, `robot` the uncertainty about a loop; `worlds` draws the
perturbed scenarios. `trials` runs settings on them and measures the results, `front` sorts these, `search`
decides with `neighbors` what to try next, and `verdict` picks the best. `tune` combines all of this with the
`options`, `answer` describes the result once for terminal, `page` and file, and `verb` writes the files.
"""
