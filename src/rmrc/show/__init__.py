"""Presentation of results: tables in a terminal and in Markdown, pictures, colors."""
