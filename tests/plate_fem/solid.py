"""A 3D solid model of a square plate on four rods, solved by CalculiX (Debian's calculix-ccx).

One quarter of the plate, x > 0 and y > 0, with symmetry or antisymmetry on the planes x = 0 and y = 0;
20-node bricks with reduced integration; the rod is meshed round and shares the nodes of its disc.
"""

import itertools
import math
import re
import subprocess

import numpy as np


def solid_modes(folder, half_m, thickness_m, place_m, diameter_m, length_m, material, symmetry, count, fine=1):
    """Modes of the solid model: (frequency_Hz (n,), node_m (k, 2), displacement (n, k, 3) of the mid-plane).

    place_m: x = y of the rod. symmetry: two letters, "s" or "a", for the planes x = 0 and y = 0.
    count: number of modes asked for. fine: refines all element sides.
    """
    plate_faces, disc_faces = _faces(half_m, place_m, diameter_m / 2, fine)
    bricks = _extrude(plate_faces, np.linspace(0, -thickness_m, 2 * fine + 1))
    rod_layers = np.linspace(-thickness_m, -thickness_m - length_m, 10 * fine + 1)
    bricks = np.concatenate([bricks, _extrude(disc_faces, rod_layers)])
    return _solve(folder, bricks, thickness_m, length_m, material, symmetry, count)


def _solve(folder, bricks, thickness_m, length_m, material, symmetry, count):
    points, number = np.unique(np.round(bricks.reshape(-1, 3), 9), axis=0, return_inverse=True)
    element = number.reshape(-1, 20) + 1
    middle = np.flatnonzero(np.isclose(points[:, 2], -thickness_m / 2))
    base = np.flatnonzero(np.isclose(points[:, 2], -thickness_m - length_m))
    deck = _deck(points, element, middle, base, material, symmetry, count)
    (folder / "solid.inp").write_text(deck)
    subprocess.run(["ccx", "solid"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return _read(folder / "solid.dat", points, middle, count)


def _faces(half, place, radius, fine):
    """Eight-node faces (n, 8, 2) of the plate and those of the rod's disc."""
    s = 1.8 * radius
    sides = [(0.0, place - s, 8), (place - s, place + s, 4), (place + s, half, 2)]
    plate = []
    for (x0, x1, nx), (y0, y1, ny) in itertools.product(sides, sides):
        if x0 > 0 and y0 > 0 and x1 < half and y1 < half:
            continue
        plate.append(_patch(lambda a, b, r=(x0, x1, y0, y1): _bilinear(a, b, *r), nx * fine, ny * fine))
    around, disc = _rod_faces(np.array([[[place]], [[place]]]), radius, s, fine)
    return np.concatenate(plate + around + disc), np.concatenate(disc)


def _rod_faces(place, radius, s, fine):
    """Patches about a rod at place (2, 1, 1): from its square of half side s to its circle, and those of its disc."""
    around, disc = [], []
    for quarter in range(4):  # around the disc: square to circle, circle to core

        def ring(a, b, outer, q=quarter):
            angle = math.pi / 2 * (q + a) - math.pi / 4
            circle = radius * np.array([np.cos(angle), np.sin(angle)])
            turn = np.array([[0, -1], [1, 0]])
            rotation = np.linalg.matrix_power(turn, q)

            def square(h):
                return np.tensordot(rotation, np.array([np.full_like(a, h), h * (2 * a - 1)]), 1)

            start, end = (square(s), circle) if outer else (circle, square(0.5 * radius))
            return place + start + b * (end - start)

        around.append(_patch(lambda a, b, f=ring: f(a, b, True), 4 * fine, 2 * fine))
        disc.append(_patch(lambda a, b, f=ring: f(a, b, False), 4 * fine, 2 * fine))
    half = 0.5 * radius
    disc.append(_patch(lambda a, b: place + _bilinear(a, b, -half, half, -half, half), 4 * fine, 4 * fine))
    return around, disc


def _bilinear(a, b, x0, x1, y0, y1):
    return np.array([x0 + a * (x1 - x0), y0 + b * (y1 - y0)])


def _patch(mapping, n, m):
    """Faces (n m, 8, 2) of a patch: corners counter-clockwise, then the middles of the sides."""
    a, b = np.meshgrid(np.arange(2 * n + 1) / (2 * n), np.arange(2 * m + 1) / (2 * m), indexing="ij")
    grid = mapping(a, b)
    offsets = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    faces = np.stack([grid[:, i : i + 2 * n - 1 : 2, j : j + 2 * m - 1 : 2] for i, j in offsets], axis=-1)
    faces = np.moveaxis(faces.reshape(2, n * m, 8), 0, 2)
    x, y = faces[:, :4, 0], faces[:, :4, 1]
    area = np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1)
    return np.where((area > 0)[:, None, None], faces, faces[:, [0, 3, 2, 1, 7, 6, 5, 4]])


def _extrude(faces, levels):
    """Twenty-node bricks (n, 20, 3) between levels given from the top down."""
    bricks = []
    for top, low in itertools.pairwise(levels):

        def at(nodes, z):
            return np.concatenate([nodes, np.full((*nodes.shape[:2], 1), z)], axis=2)

        corners, middles = faces[:, :4], faces[:, 4:]
        bricks.append(np.concatenate([at(corners, low), at(corners, top), at(middles, low), at(middles, top),
                                      at(corners, (low + top) / 2)], axis=1))  # fmt: skip
    return np.concatenate(bricks)


def _deck(points, element, middle, base, material, symmetry, count):
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.9g},{y:.9g},{z:.9g}" for i, (x, y, z) in enumerate(points, 1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SOLID")
    for i, nodes in enumerate(element, 1):
        lines += [f"{i}," + ",".join(map(str, nodes[:10])) + ",", ",".join(map(str, nodes[10:]))]
    lines += ["*NSET, NSET=MIDDLE", *(str(i + 1) for i in middle)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{material['youngs_modulus_Pa']},{material['poisson_ratio']}"]
    lines += ["*DENSITY", f"{material['density_kg_m3']}", "*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL", "*BOUNDARY"]
    lines += [f"{i + 1},1,3" for i in base]
    for axis, kind in enumerate(symmetry):
        held = [axis + 1] if kind == "s" else [d for d in (1, 2, 3) if d != axis + 1]
        plane = np.flatnonzero(np.isclose(points[:, axis], 0))
        lines += [f"{i + 1},{d},{d}" for i in plane for d in held]
    lines += ["*STEP", "*FREQUENCY", f"{count}", "*NODE PRINT, NSET=MIDDLE", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _read(file, points, middle, count):
    text = re.sub(r"(\d)([-+]\d{3})\b", r"\1E\2", file.read_text())  # Fortran leaves out the E of long exponents
    table = text[text.index("E I G E N V A L U E") :]
    rows = re.findall(r"^\s+(\d+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s*$", table, re.MULTILINE)
    frequency = np.array([float(row[3]) for row in rows[:count]])
    blocks = text.split("displacements (vx,vy,vz) for set MIDDLE")[1:]
    displacement = np.array([[line.split()[1:] for line in _lines(block, len(middle))] for block in blocks], float)
    return frequency, points[middle, :2], displacement


def _lines(block, count):
    rows = [line for line in block.splitlines()[1:] if line.strip()]
    return rows[:count]


def unlike_rods_modes(folder, half_m, thickness_m, place_m, diameters_m, length_m, material, count, fine=1):
    """Modes of a whole plate on four unlike rods: (frequency_Hz (n,), node_m (k, 2), displacement (n, k, 3)).

    half_m, place_m: pairs along x and y. diameters_m: of the rods at (-, -), (-, +), (+, -), (+, +). The displacement
    is that of the mid-plane, and the modes are mass-normalised, kg^-1/2.
    """
    square = 1.8 * max(diameters_m) / 2
    lines = [
        [-h, -p - square, -p + square, p - square, p + square, h] for h, p in zip(half_m, place_m, strict=True)]
    cells = [2 * fine, 4 * fine, 16 * fine, 4 * fine, 2 * fine]
    plate, discs = [], []
    for (i, nx), (j, ny) in itertools.product(enumerate(cells), enumerate(cells)):
        if i in (1, 3) and j in (1, 3):
            continue
        corners = lines[0][i], lines[0][i + 1], lines[1][j], lines[1][j + 1]
        plate.append(_patch(lambda a, b, r=corners: _bilinear(a, b, *r), nx, ny))
    signs = itertools.product((-1, 1), (-1, 1))
    for (sx, sy), diameter in zip(signs, diameters_m, strict=True):
        around, disc = _rod_faces(np.array([[[sx * place_m[0]]], [[sy * place_m[1]]]]), diameter / 2, square, fine)
        plate += [*around, *disc]
        discs += disc
    bricks = _extrude(np.concatenate(plate), np.linspace(0, -thickness_m, 2 * fine + 1))
    rod_layers = np.linspace(-thickness_m, -thickness_m - length_m, 10 * fine + 1)
    bricks = np.concatenate([bricks, _extrude(np.concatenate(discs), rod_layers)])
    return _solve(folder, bricks, thickness_m, length_m, material, "", count)
