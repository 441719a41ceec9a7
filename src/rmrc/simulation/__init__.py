"""From a scenario to ticks: its path is timed, it is checked and prepared, and its worlds are stepped."""
