"""The joint positions that bring a site to a pose: one, many, or all of them."""
