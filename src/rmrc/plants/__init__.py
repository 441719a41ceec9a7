"""The plants that obey the commanded rates, stepped with the law on MuJoCo's batches."""
