"""Files that differ in a few words from others."""


def replaced(folder, path, changes):
    """Write a file with some texts instead of others, each of which must be there; return it."""
    text = path.read_text()
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    (folder / path.name).write_text(text)
    return folder / path.name
