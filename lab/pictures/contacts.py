"""Stress of the plate about the contacts of one instant: `python -m lab.pictures.contacts RUN PICTURE`; needs pyvista.

Left the bending of the whole plate, right the patches of view.pvd about the contacts, at the instant of
contacts.parquet with the largest force.
"""

import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pyvista as pv


def main(run: Path, picture: Path) -> None:
    contacts = pd.read_parquet(run / "contacts.parquet")
    sets = ElementTree.parse(run / "view.pvd").getroot().findall("./Collection/DataSet")
    files = {(round(1e9 * float(s.attrib["timestep"])), s.attrib["part"]): run / s.attrib["file"] for s in sets}
    force = contacts.groupby("t_s")["force_N"].sum()
    t = next(t for t in force.sort_values(ascending=False).index if (round(1e9 * t), "3") in files)
    plate, patches = (pv.read(files[round(1e9 * t), part]) for part in "23")
    here = contacts[contacts["t_s"] == t]
    middle = here[["x_m", "y_m"]].mean().to_numpy()
    for mesh in (plate, patches):
        mesh["MPa"] = 1e-6 * mesh["von_mises_with_contacts_Pa" if mesh is patches else "von_mises_Pa"]
    plotter = pv.Plotter(shape=(1, 2), off_screen=True, window_size=(1400, 640))
    bar = {"vertical": False, "fmt": "%.3g", "color": "black"}
    plotter.add_mesh(plate, scalars="MPa", cmap="viridis", scalar_bar_args=bar | {"title": "bending, MPa"})
    plotter.add_text(f"{1e3 * t:.2f} ms, {force[t]:.0f} N", color="black", font_size=10)
    plotter.view_xy()
    plotter.camera.zoom(1.3)
    plotter.subplot(0, 1)
    plotter.add_mesh(patches, scalars="MPa", cmap="inferno", scalar_bar_args=bar | {"title": "with contacts, MPa"})
    plotter.view_xy()
    span = max(np.ptp(patches.points[:, 0]), np.ptp(patches.points[:, 1]))
    plotter.camera.focal_point = (*middle, 0)
    plotter.camera.position = (*middle, 1)
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 0.75 * span
    plotter.set_background("white", all_renderers=True)
    plotter.screenshot(picture)
    print(f"{len(here)} contacts at {1e3 * t:.2f} ms; plate {plate['MPa'].max():.1f} MPa, "
          f"patches {patches['MPa'].max():.0f} MPa, "
          f"patches span x {patches.points[:, 0].min():.4f}..{patches.points[:, 0].max():.4f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
