"""What broke: cracks, damage and fragments of the agglomerates (Figures 13-15).

A bond between two sub-spheres stands for a piece of section of its area; when it breaks, that area is crack.
Sub-sphere i, with b_i bonds at the start, has the damage D_i = (its broken bonds) / b_i, and the damaged volume of an
agglomerate is the sum of V_i D_i. Fragments are what intact bonds still hold together.
"""

from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analysis.signals.records import RecordError
from analysis.sweep.runs import Run
from common.channels import force_column
from common.files.whole import refuse_irregular
from common.scene.stones import KINDS

#: Two contacts of one agglomerate closer in time than this are one collision: within it the fragments of one impact
#: touch and leave. A first impact lasts about 0.25 ms.
COLLISION_GAP_S = 2e-4

#: Contacts below this share of an agglomerate's largest force are those of splinters and no collision.
LEAST_FORCE_SHARE = 0.01

INDEX_NUMBERS = 9  # of a stone in the file of a stream: whole numbers, spin

#: Sub-spheres that lost at least this share of their bonds count as broken in a section.
BROKEN_SHARE = 0.5


@dataclass(frozen=True)
class Network:
    """The n sub-spheres and m bonds of a run before the impact.

    centre_m (n, 3), radius_m (n,), agglomerate (n,): of each sub-sphere; agglomerates are numbered from 1.
    first, second (m,): the two sub-spheres of each bond, numbered from 0.
    """

    centre_m: np.ndarray
    radius_m: np.ndarray
    agglomerate: np.ndarray
    first: np.ndarray
    second: np.ndarray

    @property
    def volume_m3(self) -> np.ndarray:
        return 4.0 / 3.0 * np.pi * self.radius_m**3

    @property
    def bonds_of_each(self) -> np.ndarray:
        """Number of bonds of each sub-sphere at the start (n,)."""
        return _ends(self, np.ones(self.first.size, dtype=bool))


def read_network(run: Run) -> Network:
    """Read sub-spheres and bonds from a run's deck; spheres have no bonds. Raises RecordError if there is no deck."""
    deck = run.path / "deck"
    if (deck / "stones.bin").is_file():
        return _network_of_stream(deck / "stones.bin")
    try:
        for name in ("atoms.data", "agglomerates.txt", "bonds.txt"):
            refuse_irregular(deck / name)
        atoms = _read_atoms(deck / "atoms.data")
        sizes = np.loadtxt(deck / "agglomerates.txt", dtype=int, ndmin=1)
        bonds = np.zeros((0, 2), dtype=int)
        if run.summary.n_bonds != 0:
            bonds = np.loadtxt(deck / "bonds.txt", usecols=(0, 1), ndmin=2).astype(int)
    except (OSError, ValueError) as error:
        raise RecordError(f"{deck}: no sub-spheres and bonds ({' '.join(str(error).split())})") from None
    if sizes.sum() != len(atoms):
        raise RecordError(f"{deck}/agglomerates.txt: {sizes.sum()} sub-spheres; atoms.data has {len(atoms)}")
    agglomerate = np.repeat(np.arange(1, sizes.size + 1), sizes)
    return Network(atoms[:, 4:7], 0.5 * atoms[:, 2], agglomerate, bonds[:, 0] - 1, bonds[:, 1] - 1)


def _network_of_stream(file: Path) -> Network:
    """Of the stones of a stream, each as it is where it enters (dem/engine/stones/stone_file.h)."""
    numbers = np.fromfile(file, dtype="<f8")
    whole = numbers.view("<i8")
    if len(numbers) < 2 or len(numbers) < 3 + whole[1] + INDEX_NUMBERS * whole[0]:
        needed = 8 * (3 + int(whole[1]) + INDEX_NUMBERS * int(whole[0])) if len(numbers) > 1 else 16
        raise RecordError(f"{file}: cut off; needs its {needed} bytes of index")
    index = whole[3 + whole[1]:][: INDEX_NUMBERS * whole[0]].reshape(-1, INDEX_NUMBERS)
    if (index[:1, 1] != 8 * (3 + whole[1] + INDEX_NUMBERS * whole[0])).any():
        raise RecordError(f"{file}: its stones do not begin behind its index; it is of another version")
    atoms, bonds = [], []
    for _, at, n_atoms, n_bonds, *_ in index.tolist():
        own = numbers[at // 8:][: 9 * n_atoms + 8 * n_bonds]
        if len(own) < 9 * n_atoms + 8 * n_bonds:
            raise RecordError(f"{file}: cut off; its index names {n_atoms} sub-spheres at byte {at}")
        atoms.append(own[: 9 * n_atoms].reshape(-1, 9))
        bonds.append(own[9 * n_atoms:].reshape(-1, 8)[:, :2].astype(int) - 1)
    rows, ends = np.vstack(atoms), np.vstack(bonds)
    agglomerate = np.repeat(np.arange(1, len(index) + 1), index[:, 2])
    return Network(rows[:, 3:6], 0.5 * rows[:, 1], agglomerate, ends[:, 0], ends[:, 1])


def _read_atoms(path: Path) -> np.ndarray:
    """Rows id, type, diameter, density, x, y, z below "Atoms", by id."""
    lines = path.read_text().splitlines()
    atoms = np.loadtxt(list(takewhile(str.strip, lines[lines.index("Atoms") + 2 :])), ndmin=2)
    return atoms[np.argsort(atoms[:, 0])]


def broken_bonds(run: Run, network: Network, until_s: float | np.ndarray = np.inf) -> np.ndarray:
    """Whether each bond (m,) has broken by a time: one for all, or one for each agglomerate. Raises RecordError for a
    table without the numbers of the bonds."""
    table = run.breakage
    until_s = np.broadcast_to(until_s, network.agglomerate.max())
    early = table["t_s"].to_numpy() <= until_s[table["agglomerate"].to_numpy(dtype=int) - 1]
    broken = np.zeros(network.first.size, dtype=bool)
    if "bond" not in table.columns:
        raise RecordError(f"{run.path}/breakage.parquet: no column 'bond'; needs it for fragments and damage")
    broken[table["bond"].to_numpy(dtype=int)[early] - 1] = True
    return broken


def _ends(network: Network, chosen: np.ndarray) -> np.ndarray:
    """Return the number of chosen bonds at each sub-sphere (n,)."""
    ends = np.concatenate([network.first[chosen], network.second[chosen]])
    return np.bincount(ends, minlength=network.radius_m.size)


def damage(network: Network, broken: np.ndarray) -> np.ndarray:
    """Return the broken share of the bonds of each sub-sphere (n,), 0..1; it is 0 for one without bonds."""
    return _ends(network, broken) / np.maximum(network.bonds_of_each, 1)


def damaged_volume_share(network: Network, broken: np.ndarray) -> np.ndarray:
    """Return the damaged share of the volume of each agglomerate (count,), 0..1."""
    volume = network.volume_m3
    lost = np.bincount(network.agglomerate, volume * damage(network, broken))
    return lost[1:] / np.bincount(network.agglomerate, volume)[1:]


def fragments(network: Network, broken: np.ndarray) -> np.ndarray:
    """Return the number of the fragment that each sub-sphere (n,) belongs to, from 0."""
    intact = ~broken
    ends = (network.first[intact], network.second[intact])
    graph = coo_array((np.ones(ends[0].size), ends), shape=(network.radius_m.size,) * 2)
    return connected_components(graph, directed=False)[1]


def fragment_shares(network: Network, broken: np.ndarray) -> list[np.ndarray]:
    """Return the volumes of the fragments of each agglomerate as shares of its own, largest first."""
    label, volume = fragments(network, broken), network.volume_m3
    shares = []
    for number in range(1, network.agglomerate.max() + 1):
        own = network.agglomerate == number
        pieces = np.bincount(label[own], volume[own])
        shares.append(np.sort(pieces[pieces > 0])[::-1] / volume[own].sum())
    return shares


def broken_area_m2(run: Run, until_s: float | np.ndarray = np.inf) -> np.ndarray:
    """Return the crack area of each agglomerate (count,) by a time, m^2; the time is given as for `broken_bonds`."""
    table = run.breakage
    count = len(run.materials)
    number = table["agglomerate"].to_numpy(dtype=int)
    early = table["t_s"].to_numpy() <= np.broadcast_to(until_s, count)[number - 1]
    return np.bincount(number[early], table["area_m2"].to_numpy()[early], minlength=count + 1)[1:]


def broken_area_over_time(run: Run, t_s: np.ndarray) -> np.ndarray:
    """Return the crack area of each agglomerate at each time (count, times), m^2."""
    return np.stack([broken_area_m2(run, t) for t in t_s], axis=1)


def crack_counts(run: Run) -> dict[str, dict[str, int]]:
    """Return the number of broken bonds by material, coal or gangue, and by mode, tension or shear."""
    material = np.array(run.materials)[run.breakage["agglomerate"].to_numpy(dtype=int) - 1]
    mode = run.breakage["mode"].to_numpy()
    return {kind: {name: int(np.sum((material == kind) & (mode == name))) for name in ("tension", "shear")}
            for kind in KINDS}


def collisions(run: Run, agglomerate: int) -> list[tuple[float, float]]:
    """Begin and end (s) of each collision of an agglomerate with the plate: contacts less than COLLISION_GAP_S apart
    whose force is at least LEAST_FORCE_SHARE of its largest. Raises RecordError if the run has no force of it."""
    table = run.finest
    column = force_column(agglomerate)
    if column not in table.columns:
        raise RecordError(f"{run.path}: no column {column!r} in the streams")
    t_s = table["t_s"].to_numpy(dtype=float)
    force_N = table[column].to_numpy(dtype=float)
    touching = np.flatnonzero(force_N)
    if touching.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(t_s[touching]) > COLLISION_GAP_S)
    firsts = touching[np.concatenate([[0], breaks + 1])]
    lasts = touching[np.concatenate([breaks, [touching.size - 1]])]
    largest = [force_N[first:last + 1].max() for first, last in zip(firsts, lasts, strict=True)]
    hard = np.array(largest) >= LEAST_FORCE_SHARE * max(largest)
    return list(zip(t_s[firsts[hard]].tolist(), t_s[lasts[hard]].tolist(), strict=True))


def first_collision_end_s(run: Run) -> np.ndarray:
    """Return the time (count,) at which the first collision of each agglomerate ends; without one, the record's end."""
    ends = []
    for number in range(1, len(run.materials) + 1):
        found = collisions(run, number)
        ends.append(found[0][1] if found else run.t_s[-1])
    return np.array(ends)


@dataclass(frozen=True)
class Section:
    """Discs in which a plane cuts the k sub-spheres of an undeformed agglomerate. centre_m (k, 2): along the section
    and upward, from its centre; radius_m, damage (k,)."""

    centre_m: np.ndarray
    radius_m: np.ndarray
    damage: np.ndarray

    @property
    def area_m2(self) -> float:
        return float(np.pi * np.sum(self.radius_m**2))

    @property
    def broken_area_m2(self) -> float:
        """Area of the discs whose damage is at least BROKEN_SHARE."""
        return float(np.pi * np.sum(self.radius_m[self.damage >= BROKEN_SHARE] ** 2))


def section(network: Network, damaged: np.ndarray, agglomerate: int) -> Section:
    """The vertical section y = const through the middle of an agglomerate (Figures 14, 15); `damaged` (n,) from
    `damage`."""
    own = network.agglomerate == agglomerate
    place, radius = network.centre_m[own], network.radius_m[own]
    middle = np.average(place, axis=0, weights=radius**3)
    distance = place[:, 1] - middle[1]
    cut = np.abs(distance) < radius
    centre = place[cut][:, [0, 2]] - middle[[0, 2]]
    return Section(centre, np.sqrt(radius[cut] ** 2 - distance[cut] ** 2), damaged[own][cut])
