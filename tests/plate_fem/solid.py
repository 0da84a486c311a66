"""A plate on rods as a 3D solid, solved by CalculiX (Debian's calculix-ccx), which knows nothing of plate theory.

A part of the plate, cut where it is its own mirror image; 20-node bricks with reduced integration. Rods are meshed
round and share the nodes of their disc. Bricks become thinner towards the edge where rod and plate meet.
"""

import itertools
import math
import re
import subprocess
from dataclasses import dataclass

import numpy as np

TO_CIRCLE, FROM_CIRCLE = np.array([0, 0.5, 0.8, 0.94, 0.985, 1]), np.array([0, 0.03, 0.12, 0.4, 1])  # square to core
PLATE_LAYERS = np.array([0, 0.5, 0.8, 0.94, 0.985, 1])  # in thicknesses, from the top
ROD_LAYERS = np.array([0, 0.015, 0.06, 0.2, 0.5, 1])  # in radii, from the plate


@dataclass(frozen=True)
class Part:
    """Of a plate: x_m, y_m are its ends, 0 at a mirror; rods are (x, y, diameter), all as long; cell_m is the side of
    its bricks away from rods. `fine` divides it, and those through the thickness, along rods and towards them.
    ribs below the plate are (axis along which one runs, place of its middle on the other, width, height)."""

    x_m: tuple
    y_m: tuple
    thickness_m: float
    rods: tuple
    length_m: float
    material: dict
    cell_m: float
    fine: float = 1
    ribs: tuple = ()

    def bricks(self):
        plate, discs, below = _faces(self)
        halves = _finer(PLATE_LAYERS[:2], self.fine), _finer(PLATE_LAYERS[1:], self.fine)[1:]  # nodes in the mid-plane
        top = -self.thickness_m * np.concatenate(halves)
        found = [_extrude(np.concatenate(plate), top)]
        for disc, (_, _, diameter) in zip(discs, self.rods, strict=True):
            steep = diameter / 2 * ROD_LAYERS
            even = np.linspace(steep[-1], self.length_m, 1 + math.ceil((self.length_m - steep[-1]) / steep[-1]))[1:]
            found.append(_extrude(disc, -self.thickness_m - _finer(np.append(steep, even), self.fine)))
        for faces, height in below:
            layers = np.linspace(0, height, 1 + math.ceil(height * self.fine / self.thickness_m))
            found.append(_extrude(faces, -self.thickness_m - layers))
        return np.concatenate(found)


@dataclass(frozen=True)
class Found:
    """frequency_Hz (n,), mass-normalised displacement (n, k, 3) of the mid-plane at node_m (k, 2), force_N
    (n, rods) upwards on the feet, and `sag_m` (k,), the deflection under gravity, of a part without antisymmetry."""

    frequency_Hz: np.ndarray
    node_m: np.ndarray
    motion: np.ndarray
    force_N: np.ndarray
    sag_m: np.ndarray | None


def solved(folder, part, symmetry, count):
    """Modes of a plate by `count` modes of its part. symmetry: "s" or "a" for the mirrors x = 0 and y = 0, or "-"."""
    bricks = part.bricks()
    points, number = np.unique(np.round(bricks.reshape(-1, 3), 9), axis=0, return_inverse=True)
    middle = np.flatnonzero(np.isclose(points[:, 2], -part.thickness_m / 2))
    base = np.isclose(points[:, 2], -part.thickness_m - part.length_m)
    feet = [np.flatnonzero(base & (np.hypot(points[:, 0] - x, points[:, 1] - y) < 0.51 * d)) for x, y, d in part.rods]
    sags = "a" not in symmetry
    deck = _deck(part, points, number.reshape(-1, 20) + 1, middle, feet, symmetry, count, sags)
    (folder / "solid.inp").write_text(deck)
    subprocess.run(["ccx", "solid"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    text = re.sub(r"(\d)([-+]\d{3})\b", r"\1E\2", (folder / "solid.dat").read_text())  # Fortran's long exponents lack E
    blocks = text.split("displacements (vx,vy,vz) for set MIDDLE")[1:]
    motion = np.array([[line.split()[1:] for line in _lines(block, len(middle))] for block in blocks], float)
    totals = re.findall(r"total force \(fx,fy,fz\) for set FOOT\d+ and time\s+\S+\s+(\S+)\s+(\S+)\s+(\S+)", text)
    force = np.array(totals, float)[:, 2].reshape(-1, len(feet))
    table = text[text.index("E I G E N V A L U E") :]
    rows = re.findall(r"^\s+(\d+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s+([-\d.E+]+)\s*$", table, re.MULTILINE)
    whole = np.sqrt(2.0 ** sum(kind != "-" for kind in symmetry))
    return Found(np.array([float(row[3]) for row in rows[:count]]), points[middle, :2], motion[-count:] / whole,
                 force[-count:] / whole, motion[0, :, 2] if sags else None)


def solid_modes(folder, half_m, thickness_m, place_m, diameter_m, length_m, material, symmetry, count, fine=1):
    """Of a square plate on four rods: (frequency_Hz (n,), node_m (k, 2), displacement (n, k, 3)), mass-normalised for
    the quarter. place_m: x = y of the rod."""
    ends, rods = (0, half_m), ((place_m, place_m, diameter_m),)
    part = Part(ends, ends, thickness_m, rods, length_m, material, half_m / 10, fine)
    found = solved(folder, part, symmetry, count)
    return found.frequency_Hz, found.node_m, 2 * found.motion


def unlike_rods_modes(folder, half_m, thickness_m, place_m, diameters_m, length_m, material, count, fine=1):
    """Modes of a whole plate on four unlike rods: (frequency_Hz (n,), node_m (k, 2), displacement (n, k, 3)).

    half_m, place_m: pairs along x and y. diameters_m: of the rods at (-, -), (-, +), (+, -), (+, +).
    """
    signs = itertools.product((-1, 1), (-1, 1))
    rods = tuple((sx * place_m[0], sy * place_m[1], d) for (sx, sy), d in zip(signs, diameters_m, strict=True))
    x_m, y_m = ((-half, half) for half in half_m)
    found = solved(folder, Part(x_m, y_m, thickness_m, rods, length_m, material, max(half_m) / 9, fine), "--", count)
    return found.frequency_Hz, found.node_m, found.motion


def _finer(lines, fine):
    cells = len(lines) - 1
    return np.interp(np.linspace(0, cells, 1 + round(fine * cells)), np.arange(cells + 1), lines)


def _faces(part):
    """Eight-node faces (n, 8, 2): a list of the plate's, of each rod's disc, and of what stands on ribs, with their
    height."""
    square = 0.9 * max(diameter for *_, diameter in part.rods)
    lines = []
    for axis, ends in enumerate((part.x_m, part.y_m)):
        at = [*ends, *(rod[axis] + side * square for rod in part.rods for side in (-1, 1))]
        at += [at_m + side * width / 2 for along, at_m, width, _ in part.ribs for side in (-1, 1) if along != axis]
        lines.append(sorted(set(np.round([one for one in at if ends[0] <= one <= ends[1]], 9))))
    plate, discs, below = [], [], []
    for (x0, x1), (y0, y1) in itertools.product(*map(itertools.pairwise, lines)):
        if any(x0 < x < x1 and y0 < y < y1 for x, y, _ in part.rods):
            continue
        sides = [_side(part, a, b, square) for a, b in ((x0, x1), (y0, y1))]
        plate.append(_patch(lambda a, b, r=(x0, x1, y0, y1): _bilinear(a, b, *r), *sides))
        middle = (x0 + x1) / 2, (y0 + y1) / 2
        heights = [height for along, at_m, width, height in part.ribs if abs(middle[1 - along] - at_m) < width / 2]
        below += [(plate[-1], max(heights))] if heights else []
    for x, y, diameter in part.rods:
        around, disc = _rod_faces(np.array([[[x]], [[y]]]), diameter / 2, square, part.fine)
        plate += [*around, *disc]
        discs.append(np.concatenate(disc))
    return plate, discs, below


def _side(part, start, end, square):
    at_rod = abs(end - start - 2 * square) < 1e-6
    return np.linspace(0, 1, 1 + (4 if at_rod else math.ceil((end - start) * part.fine / part.cell_m - 1e-9)))


def _rod_faces(place, radius, s, fine):
    """Patches about a rod at place (2, 1, 1): from its square of half side s to its circle, and those of its disc."""
    around, disc, along = [], [], np.linspace(0, 1, 5)
    for quarter in range(4):

        def ring(a, b, outer, q=quarter):
            angle = math.pi / 2 * (q + a) - math.pi / 4
            circle = radius * np.array([np.cos(angle), np.sin(angle)])
            turn = np.array([[0, -1], [1, 0]])
            rotation = np.linalg.matrix_power(turn, q)

            def square(h):
                return np.tensordot(rotation, np.array([np.full_like(a, h), h * (2 * a - 1)]), 1)

            start, end = (square(s), circle) if outer else (circle, square(0.5 * radius))
            return place + start + b * (end - start)

        around.append(_patch(lambda a, b, f=ring: f(a, b, True), along, _finer(TO_CIRCLE, fine)))
        disc.append(_patch(lambda a, b, f=ring: f(a, b, False), along, _finer(FROM_CIRCLE, fine)))
    half = 0.5 * radius
    disc.append(_patch(lambda a, b: place + _bilinear(a, b, -half, half, -half, half), along, along))
    return around, disc


def _bilinear(a, b, x0, x1, y0, y1):
    return np.array([x0 + a * (x1 - x0), y0 + b * (y1 - y0)])


def _patch(mapping, along_a, along_b):
    """Faces (n m, 8, 2) of a patch between lines: corners counter-clockwise, then the middles of the sides."""
    n, m = len(along_a) - 1, len(along_b) - 1
    grid = mapping(*np.meshgrid(_finer(along_a, 2), _finer(along_b, 2), indexing="ij"))
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


def _deck(part, points, element, middle, feet, symmetry, count, sags):
    material, lines = part.material, ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.9g},{y:.9g},{z:.9g}" for i, (x, y, z) in enumerate(points, 1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SOLID")
    for i, nodes in enumerate(element, 1):
        lines += [f"{i}," + ",".join(map(str, nodes[:10])) + ",", ",".join(map(str, nodes[10:]))]
    for name, chosen in {"MIDDLE": middle, **{f"FOOT{k}": foot for k, foot in enumerate(feet)}}.items():
        lines += [f"*NSET, NSET={name}", *(str(i + 1) for i in chosen)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{material['youngs_modulus_Pa']},{material['poisson_ratio']}"]
    lines += ["*DENSITY", f"{material['density_kg_m3']}", "*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL", "*BOUNDARY"]
    lines += [f"{i + 1},1,3" for foot in feet for i in foot]
    for axis, kind in enumerate(symmetry):
        held = {"s": [axis + 1], "a": [d for d in (1, 2, 3) if d != axis + 1], "-": []}[kind]
        plane = np.flatnonzero(np.isclose(points[:, axis], 0))
        lines += [f"{i + 1},{d},{d}" for i in plane for d in held]
    printed = ["*NODE PRINT, NSET=MIDDLE", "U"]
    for k in range(len(feet)):
        printed += [f"*NODE PRINT, NSET=FOOT{k}, TOTALS=ONLY", "RF"]
    if sags:
        lines += ["*STEP", "*STATIC", "*DLOAD", "SOLID,GRAV,9.81,0,0,-1", *printed, "*END STEP"]
    lines += ["*STEP", "*FREQUENCY", f"{count}", *printed, "*END STEP"]
    return "\n".join(lines) + "\n"


def _lines(block, count):
    rows = [line for line in block.splitlines()[1:] if line.strip()]
    return rows[:count]
