"""From a scenario to ticks: timing of the path, checks, preparation, and stepping of the worlds."""
