"""What a run leaves behind for people: recordings, tables, the viewer."""
