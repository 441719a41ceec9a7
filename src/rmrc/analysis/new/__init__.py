"""A first scenario for an arm: every number scaled to the arm, with its reason."""
