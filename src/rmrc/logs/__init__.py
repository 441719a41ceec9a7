"""Logs and recorded motions of other programs: tables in files, and columns found by their names."""
