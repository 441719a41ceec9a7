"""Where a site can be, and where it is singular there."""
