"""Pictures and films of runs: MuJoCo's renderer off screen, the rates below it, as PNG, GIF or MP4."""
