"""The law outside of Python: as WebAssembly for a page, and as an object for C. It is the same law."""
