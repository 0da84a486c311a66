"""Pictures (view.pvd) for the synthetic runs of tests/analysis: stones that fall, rebound and turn, on a plate that
swings, all by closed forms."""

import numpy as np

from analysis import read_run
from analysis.sweep import breakage
from dem.run.paraview import PARTS, Mesh, VtuWriter, write_pvd

T_S = np.concatenate([np.arange(61) * 2e-5, np.arange(1, 21) * 2e-3])  # dense in the impact, then to 40 ms
NODES = 13


def centre_m(network, t_s):
    """Sub-spheres at a time, shape (n, 3): 3 m/s down for 0.2 ms, then 1 m/s up, turning by 1 rad in 40 ms."""
    middle = np.stack([
        network.centre_m[network.agglomerate == k].mean(axis=0) for k in range(1, network.agglomerate.max() + 1)
    ])[network.agglomerate - 1]  # fmt: skip
    x, y, z = (network.centre_m - middle).T
    angle = 25.0 * t_s
    turned = np.column_stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])
    turned[:, 2] += -3.0 * min(t_s, 2e-4) + 1.0 * max(0.0, t_s - 2e-4)
    return middle + turned


def deflection_m(node_m, t_s):
    return -1e-4 * np.sin(2 * np.pi * 400 * t_s) * np.cos(np.pi * node_m[:, 0]) * np.cos(np.pi * node_m[:, 1])


def stress_Pa(node_m, t_s):
    return 2e11 * np.abs(deflection_m(node_m, t_s))


def plate_mesh():
    line = np.linspace(-0.25, 0.25, NODES)
    node_m = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(NODES**2).reshape(NODES, NODES)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    return node_m, np.stack(corners, axis=-1).reshape(-1, 4)


def write_view(run_directory):
    """Write view.pvd as dem/run/paraview.py does, and return the sub-spheres and bonds that it shows."""
    network = breakage.read_network(read_run(run_directory))
    node_m, quad = plate_mesh()
    (run_directory / "view").mkdir()
    writers, entries = {"particles": VtuWriter(), "plate": VtuWriter()}, []
    for k, t_s in enumerate(T_S):
        points, w_m = centre_m(network, t_s), deflection_m(node_m, t_s)
        meshes = {
            "particles": Mesh(points, np.arange(len(points)).reshape(-1, 1), {
                "radius_m": network.radius_m, "agglomerate": network.agglomerate.astype("u2")}),
            "plate": Mesh(np.column_stack([node_m, np.zeros(len(node_m))]), quad, {
                "displacement_m": np.column_stack([np.zeros((len(w_m), 2)), w_m]),
                "von_mises_Pa": stress_Pa(node_m, t_s)})}
        for name, mesh in meshes.items():
            writers[name].write(run_directory / "view" / f"{name}_{k:04d}.vtu", mesh)
            entries.append((t_s, PARTS.index(name), f"view/{name}_{k:04d}.vtu"))
    write_pvd(run_directory / "view.pvd", entries)
    return network
