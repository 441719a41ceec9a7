"""A mesh of four triangles, as the bytes of an STL file."""

import struct


def tetrahedron(size):
    """The corner of a cube, cut off: its vertices are the origin and `size` along each axis."""
    corners = [(0, 0, 0), (size, 0, 0), (0, size, 0), (0, 0, size)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    triangles = (struct.pack("<12fH", 0, 0, 0, *corners[a], *corners[b], *corners[c], 0) for a, b, c in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + b"".join(triangles)
