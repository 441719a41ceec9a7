"""Build src/rmrc/export/law.wasm, which pages embed, from the sources of the law; it takes minutes.

    .venv/bin/pip install -e ".[wasm]"
    .venv/bin/python tools/law_wasm.py

Zig brings the linker, and musl's mathematical functions. The file ends with a section `sources`, a digest of
the sources: a test compares it with that of the sources now.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from rmrc.export import artifact
from rmrc.export.objects import NOTHING

SECTION = b"sources"


def main():
    """Compile, link, and append the digest."""
    exports = [*artifact.methods(), NOTHING, "__heap_base"]
    options = ("no-entry", "export-table", "growable-table", "gc-sections", "strip-all")
    flags = [f"-Wl,--{option}" for option in (*options, *(f"export={name}" for name in exports))]
    with tempfile.TemporaryDirectory() as folder:
        source, linked = Path(folder) / "law.o", Path(folder) / "law.wasm"
        source.write_bytes(artifact.wasm_object())
        linker = [sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi", "-mexec-model=reactor"]
        subprocess.run([*linker, *flags, source, "-lm", "-o", linked], check=True)
        payload = bytes([len(SECTION)]) + SECTION + artifact.digest()
        artifact.FILE.write_bytes(linked.read_bytes() + bytes([0, len(payload)]) + payload)
    print(f"wrote {artifact.FILE}, {artifact.FILE.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
