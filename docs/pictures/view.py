"""The README's picture from a run's view.pvd: `python docs/pictures/view.py RUN PICTURE [TIME_S]`; needs pyvista."""

import sys

import numpy as np
import pyvista as pv

run, picture = sys.argv[1:3]
time = float(sys.argv[3]) if len(sys.argv) > 3 else 3e-3

reader = pv.get_reader(f"{run}/view.pvd")
reader.set_active_time_value(min(reader.time_values, key=lambda t: abs(t - time)))
particles, bonds, plate = (reader.read()[k] for k in range(3))

plot = pv.Plotter(off_screen=True, window_size=(1400, 800))
largest = np.abs(plate["displacement_m"]).max()
plot.add_mesh(plate.warp_by_vector("displacement_m", factor=0.008 / largest), scalars="von_mises_Pa", cmap="viridis",
              scalar_bar_args={"title": "von Mises stress of the plate, Pa", "fmt": "%.1e"})
for material, colour in ((1.0, "#3a3a3a"), (2.0, "#b08d57")):
    chosen = particles.extract_points(particles["material"] == material, include_cells=False)
    if chosen.n_points:
        spheres = chosen.glyph(scale="radius_m", orient=False, factor=1.0,
                               geom=pv.Sphere(radius=1.0, theta_resolution=16, phi_resolution=16))
        plot.add_mesh(spheres, color=colour, smooth_shading=True)
plot.camera_position = [(0.28, -0.42, 0.2), (0.0, 0.0, 0.018), (0, 0, 1)]
plot.set_background("white")
plot.screenshot(picture)
print(f"{particles.n_points} sub-spheres, {bonds.n_cells} bonds that hold, t = {reader.active_time_value} s")
