"""What every room needs: rotations, errors, files, threads, signals, and what a machine allows."""
