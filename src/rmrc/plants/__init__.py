"""What obeys the commanded rates, stepped with the law on MuJoCo's batches."""
