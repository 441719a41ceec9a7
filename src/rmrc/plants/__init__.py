"""The plants that obey the commanded rates."""
