"""The workspace of a site, and its singularities."""
