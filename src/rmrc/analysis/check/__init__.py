"""Whether a model is ready to be driven: what is wrong with it, what is missing, and what is assumed."""
