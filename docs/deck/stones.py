"""Writes stones.bin, two stones that enter at the steps 0 and 3000, from atoms.data and bonds.txt (docs/decks.md)."""

import numpy as np

atoms, bonds = np.loadtxt("atoms.data", skiprows=11), np.loadtxt("bonds.txt")
# Stones, materials; least radius, greatest of each material
head = np.array([2, 1]).tobytes() + np.array([4.9e-3, 4.9e-3]).tobytes()
index, body = b"", b""
for stone, entry_step in enumerate([0, 3000]):
    first_byte = len(head) + 2 * 9 * 8 + len(body)
    # Sub-spheres, bonds, whether smooth, columns of faces; spin in rad/s
    index += np.array([entry_step, first_byte, 4, 6, 0, 0]).tobytes() + np.zeros(3).tobytes()
    # Rows of type, diameter, density, place, velocity, then of bonds as above
    body += np.column_stack([atoms[4 * stone:4 * stone + 4, 1:], np.tile([1.5, 0, -2], (4, 1))]).tobytes()
    body += bonds[6 * stone:6 * stone + 6].tobytes()
with open("stones.bin", "wb") as out:
    out.write(head + index + body)
