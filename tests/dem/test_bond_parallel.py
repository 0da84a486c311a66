"""The parallel bond of the engine against beam theory, conservation laws and its own naive twin."""

import numpy as np
import pytest
from decks import bond_line, chain, deck, fcc_ball, frames, ledger, run_engine, write_files
from scipy.spatial.transform import Rotation

from dem.run.results import read_forces
from dem.stones.bonds import Bonds
from tests.dem.highest_frequency import highest_frequency_rad_s

E, RATIO = 5e9, 2.0
LENGTH, RADIUS = 2e-3, 1e-3
K_N = E * np.pi * RADIUS**2 / LENGTH
K_S = K_N / RATIO
K_B = K_N * RADIUS**2 / 4
K_T = K_S * RADIUS**2 / 2


def beam_stiffness():
    """12 x 12 matrix of a beam along x whose shear acts at mid-length, written down from statics, not from an energy.

    Freedoms: (u, v, w, rx, ry, rz) of i, then of j. A cross-section force S = k_s (v_j - v_i - L (rz_i + rz_j)/2) and
    a moment M = k_b (rz_j - rz_i) at mid-length load the ends.
    """
    k = np.zeros((12, 12))

    def spring(stiffness, stretch):
        k[:] += stiffness * np.outer(stretch, stretch)

    def row(**freedoms):
        names = ["ui", "vi", "wi", "rxi", "ryi", "rzi", "uj", "vj", "wj", "rxj", "ryj", "rzj"]
        return np.array([freedoms.get(n, 0.0) for n in names])

    half = LENGTH / 2
    spring(K_N, row(uj=1, ui=-1))
    spring(K_S, row(vj=1, vi=-1, rzi=-half, rzj=-half))
    spring(K_S, row(wj=1, wi=-1, ryi=half, ryj=half))
    spring(K_T, row(rxj=1, rxi=-1))
    spring(K_B, row(ryj=1, ryi=-1))
    spring(K_B, row(rzj=1, rzi=-1))
    return k


# Small enough for the linear theory (errors of the square), large enough for double precision.
@pytest.mark.parametrize("name, freedom, size", [
    ("axial", 6, 1e-3 * LENGTH), ("shear y", 7, 1e-5 * LENGTH), ("shear z", 8, 1e-5 * LENGTH),
    ("twist", 9, 2e-5), ("bend about y", 10, 2e-5), ("bend about z", 11, 2e-5),
    ("bend of i about z", 5, 2e-5),
])
def test_one_bond_is_the_beam_of_theory(tmp_path, name, freedom, size):
    """Forces and torques on both ends, to 1e-9 of the largest. The spheres are so heavy that they do not give way."""
    body = chain(2)
    write_files(tmp_path, body)
    steps, dt = 20, 1e-7
    displacement = np.zeros(12)
    displacement[freedom] = size
    end, axis = freedom // 6 + 1, "xyz"[freedom % 3]
    moved = "v" if freedom % 6 < 3 else "omega"
    velocity = f"set atom 1*2 density 1e40\nset atom {end} {moved}{axis} {size / (steps * dt)!r}\n"
    run_engine(tmp_path, deck(dt, steps, steps, bonds=bond_line(E, RATIO), velocity=velocity))
    f = frames(tmp_path)
    got = np.concatenate([np.concatenate([f.force[-1, k], f.torque[-1, k]]) for k in range(2)])
    expected = -beam_stiffness() @ displacement
    force, torque = np.abs(expected.reshape(2, 2, 3)).max(axis=(0, 2))
    scale = np.tile(np.repeat([max(force, torque / LENGTH), max(torque, force * LENGTH)], 3), 2)
    # Where theory gives a force of zero the squares of the displacement remain: 1e-5 of it.
    tolerance = np.where(expected != 0, 1e-9, 3e-5)
    assert np.all(np.abs(got - expected) <= tolerance * scale)


def bond_energy_J(place_m, turned):
    """Of a bond along x between two places (2, 3) with their two rotations, as docs/bonds.md has it; k_n/k_s = 3.5."""
    branch, d0 = place_m[1] - place_m[0], np.array([1.0, 0, 0])
    length = np.linalg.norm(branch)
    mean = (turned[0].apply(d0) + turned[1].apply(d0)) / 2
    across = mean - mean @ branch * branch / length**2
    turn = 2 * (turned[0].inv() * turned[1]).as_quat()[:3]
    return 0.5 * (K_N * (length - LENGTH) ** 2 + 2 / 7 * K_N * LENGTH**2 * across @ across + 2 / 7 * K_N * RADIUS**2 / 2
                  * turn[0] ** 2 + K_B * turn[1:] @ turn[1:])


@pytest.mark.parametrize("kernel", ["plain", "sse2", "avx2", "auto"])
def test_forces_and_torques_are_the_gradient_of_the_energy_at_large_turns(tmp_path, kernel):
    """Both ends are moved by a fifth of the bond's length and turned by a third of a radian; central differences."""
    steps, dt, rng = 20, 1e-7, np.random.default_rng(2)
    moved, turn = 0.1 * LENGTH * rng.normal(size=(2, 3)), 0.2 * rng.normal(size=(2, 3))
    write_files(tmp_path, chain(2, radius=0.5e-3))  # which never touch
    rates = "".join(f"set atom {k + 1} density 1e40\n" + "".join(
        f"set atom {k + 1} v{a} {moved[k, d] / (steps * dt):.17g} omega{a} {turn[k, d] / (steps * dt):.17g}\n"
        for d, a in enumerate("xyz")) for k in range(2))
    run_engine(tmp_path, deck(dt, steps, steps, bonds=bond_line(E, 3.5, kernel=kernel), velocity=rates))
    place, turned = chain(2).center_m + moved, [Rotation.from_rotvec(t) for t in turn]
    found, step = frames(tmp_path), 1e-6

    def energy(end, shift, spin):
        other = [place.copy(), list(turned)]
        other[0][end] += shift
        other[1][end] = Rotation.from_rotvec(spin) * other[1][end]
        return bond_energy_J(*other)

    none = np.zeros(3)
    for end in range(2):
        force = [(energy(end, -LENGTH * s, none) - energy(end, LENGTH * s, none)) / (2 * LENGTH * step)
                 for s in step * np.eye(3)]
        torque = [(energy(end, none, -s) - energy(end, none, s)) / (2 * step) for s in step * np.eye(3)]
        assert found.force[-1, end] == pytest.approx(np.array(force), abs=1e-6 * np.abs(force).max())
        assert found.torque[-1, end] == pytest.approx(np.array(torque), abs=1e-6 * np.abs(torque).max())
    assert ledger(tmp_path).column["bond_elastic_J"][-1, 0] == pytest.approx(energy(0, none, none), rel=1e-9)


@pytest.mark.parametrize("kernel", ["sse2", "avx2", "avx512"])
def test_packed_kernels_agree_with_the_naive_twin(tmp_path, kernel):
    """An fcc ball hits the plate and breaks: same bonds broken at the same steps, positions to round-off."""
    results = []
    for name in ("plain", kernel):
        here = tmp_path / name
        here.mkdir()
        try:
            strike(here, name)
        except AssertionError as error:
            if "this processor has no kernel" in str(error):
                pytest.skip(f"no {kernel} on this processor")
            raise
        results.append((frames(here), (here / "events.csv").read_text().splitlines()))
    (a, events_a), (b, events_b) = results
    assert len(events_a) > 20
    keys = [sorted(line.split(",")[:2] for line in events[1:]) for events in (events_a, events_b)]
    assert keys[0] == keys[1]
    assert np.abs(a.x[-1] - b.x[-1]).max() < 1e-12


def strike(directory, kernel="auto", ranks=1, tension=2e6, damping=0.05, steps=2000, speed=5.0, elastic=False, extra="",
           **bond):
    """A ball on the rigid plate, its own deck; returns (body, dt)."""
    body = fcc_ball(5)
    body.center_m[:, 2] += 1e-5 - (body.center_m[:, 2] - body.radius_m).min()
    write_files(directory, body)
    t0 = np.sqrt(body.mass_kg.min() / K_N)
    dt = 0.2 * t0
    wall = ("fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 "
            "contact model hertz tangential history primitive type 2 zplane 0.0\n")
    bonds = bond_line(E, RATIO, tension=tension, shear=tension, damping_time=2 * damping * t0, kernel=kernel, **bond)
    text = deck(dt, steps, steps // 40, wall + extra, bonds, f"velocity all set 0.3 0.2 {-speed} units box\n")
    if elastic:
        text = text.replace("0.9 0.9 0.9 0.9", "1 1 1 1").replace(" tangential history", "")
    run_engine(directory, text, ranks)
    return body, dt


@pytest.mark.slow
def test_two_ranks_give_what_one_gives(tmp_path):
    runs = []
    for ranks in (1, 2):
        here = tmp_path / str(ranks)
        here.mkdir()
        strike(here, ranks=ranks)
        runs.append(frames(here))
    assert np.abs(runs[0].x[-1] - runs[1].x[-1]).max() < 1e-10


def test_impulse_on_the_plate_is_the_momentum_lost(tmp_path):
    _, dt = strike(tmp_path)
    forces = read_forces(tmp_path / "forces.bin")
    f = frames(tmp_path)
    lost = (f.mass[-1][:, None] * (f.v[-1] - f.v[0])).sum(axis=0)[2]
    assert forces.mean_N.sum() * dt == pytest.approx(lost, rel=1e-9)


def test_energy_of_an_unbreakable_ball_closes_without_damping(tmp_path):
    """Without damping the work that the bonds took is in them, and nowhere else."""
    strike(tmp_path, tension=1e30, damping=0.0)
    rows = ledger(tmp_path).column
    start = frames(tmp_path)
    impact = 0.5 * (start.mass[0][:, None] * start.v[0] ** 2).sum()
    damped = -rows["bond_work_J"][-1, 0] - rows["bond_elastic_J"][-1, 0]
    assert rows["bond_elastic_J"].max() > 1e-3 * impact
    assert abs(damped) < 1e-3 * impact


def trembles_on(directory, body, dt, ratio=RATIO, steps=2000, **bond):
    """Small random velocities and spins, which excite every mode: whether their energy stays what it was."""
    directory.mkdir()
    write_files(directory, body)
    v = np.random.default_rng(1).normal(size=(len(body.radius_m), 6)) * ([1e-4] * 3 + [0.1] * 3)
    lines = "".join(f"set atom {k + 1} vx {row[0]!r} vy {row[1]!r} vz {row[2]!r} "
                    f"omegax {row[3]!r} omegay {row[4]!r} omegaz {row[5]!r}\n" for k, row in enumerate(v.tolist()))
    run_engine(directory, deck(dt, steps, steps // 4, bonds=bond_line(E, ratio, **bond), velocity=lines))
    c = ledger(directory).column
    energy = (c["kinetic_J"] + c["bond_elastic_J"])[:, 0]
    return energy[-1] < 10 * energy[0]


def test_undamped_steps_are_stable_below_two_over_the_highest_frequency(tmp_path):
    """The limit of the leapfrog scheme; the frequency is that of the stiffness matrix, not of the engine."""
    body = fcc_ball(4)
    bonds = Bonds(*body.pair.T, body.center_m[body.pair[:, 1]] - body.center_m[body.pair[:, 0]], body.bond_radius_m)
    limit = 2 / highest_frequency_rad_s(bonds, E, RATIO, body.mass_kg, body.radius_m)
    assert trembles_on(tmp_path / "below", body, 0.99 * limit)
    assert not trembles_on(tmp_path / "above", body, 1.01 * limit)


def spinning(directory, turns, damping_time=0.0):
    body = fcc_ball(4)
    write_files(directory, body)
    t0 = np.sqrt(body.mass_kg.min() / K_N)
    spin = np.array([300.0, -1500.0, 1200.0])
    v = np.cross(spin, body.center_m - body.center_m.mean(axis=0))
    lines = "".join(f"set atom {k + 1} vx {a!r} vy {b!r} vz {c!r}\n" for k, (a, b, c) in enumerate(v.tolist()))
    lines += "".join(f"set atom * omega{axis} {w!r}\n" for axis, w in zip("xyz", spin.tolist()))
    dt = 0.1 * t0
    steps = int(turns * 2 * np.pi / np.linalg.norm(spin) / dt / 20) * 20
    run_engine(directory, deck(dt, steps, steps // 20, bonds=bond_line(E, RATIO, damping_time=damping_time),
                               velocity=lines))
    return frames(directory), ledger(directory)


def test_a_free_spinning_body_keeps_energy_and_angular_momentum(tmp_path):
    f, rows = spinning(tmp_path, turns=3)
    inertia = 0.4 * f.mass * f.radius**2
    momentum = (f.mass[..., None] * np.cross(f.x, f.v)).sum(axis=1) + (inertia[..., None] * f.omega).sum(axis=1)
    assert np.abs(momentum - momentum[0]).max() < 1e-6 * np.linalg.norm(momentum[0])
    energy = (rows.column["kinetic_J"] + rows.column["bond_elastic_J"])[:, 0]
    assert np.abs(energy - energy[0]).max() < 1e-6 * energy[0]


def test_a_restart_of_liggghts_is_refused(tmp_path):
    """Bonds would come back whole: fix checkpoint keeps them."""
    with pytest.raises(AssertionError, match="kept by fix checkpoint, not by LIGGGHTS' restart"):
        strike(tmp_path, damping=0.0, elastic=True, extra="restart 100 mid.*\n")
