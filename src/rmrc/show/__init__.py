"""How answers look: tables in a terminal and in Markdown, pictures, colors."""
