"""A first scenario for an arm that has none: every number scaled to the arm, and why it is that number."""
