"""An arm at one configuration: its Jacobian, the directions that it has lost, and their effect."""
