"""The layouts of a recording, read back."""

import functools

from rerun.chunk import RrdReader


def layouts(path):
    """Return all layouts of a recording: of each its components by entity; a file is read once."""
    about = path.stat()
    return _layouts(path, about.st_ino, about.st_mtime_ns, about.st_size)


@functools.lru_cache(8)
def _layouts(path, *_):
    reader, found = RrdReader(path), []
    for entry in reader.blueprints():
        tables = {}
        for chunk in reader.stream(store=entry):
            batch = chunk.to_record_batch()
            for field, values in zip(batch.schema, batch.columns, strict=True):
                if ":" in field.name:
                    tables.setdefault(chunk.entity_path, {})[field.name] = values.to_pylist()[-1]
        found.append(tables)
    return found


def last_layout(path):
    """Return the layout of a run that is over, which has most in it."""
    return max(layouts(path), key=len)
