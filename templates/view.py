"""The pictures of this run in ParaView, coloured and warped: stones by material, the plate by stress, rods by force.

In ParaView: File > Load State > view.py, or `paraview --script=view.py`. For a picture of the time nearest to 0.2 ms:

    pvpython view.py picture.png 0.0002       # without a screen: xvfb-run -a pvpython ...

Bonds (by strain) and the stress about the contacts are loaded too; the eye beside them shows them.
"""

import json
import math
import sys
from pathlib import Path

from paraview import simple

HERE = Path(__file__).resolve().parent / "view"
WARPED_M = 0.01  # the largest deflection of the plate is shown as this
COAL, GANGUE = (0.25, 0.25, 0.28), (0.85, 0.66, 0.42)


def series(name):
    """The series of one part under its name, None where the run has none."""
    file = HERE / f"{name}.pvd"
    return simple.PVDReader(registrationName=name, FileName=str(file)) if file.exists() else None


def largest(reader, association, array):
    """Of the magnitude of an array at all times."""
    most = 0.0
    for t in reader.TimestepValues:
        reader.UpdatePipeline(t)
        found = getattr(reader, association).GetArray(array)
        most = max(most, *map(abs, found.GetRange(-1 if found.GetNumberOfComponents() > 1 else 0)))
    return most or 1.0


def show(view, source, association, array, preset, low, high, title="", corner="Lower Right Corner"):
    """Show a source, coloured by an array between two values, with a legend unless the title is empty."""
    display = simple.Show(source, view)
    simple.ColorBy(display, (association, array))
    colours = simple.GetColorTransferFunction(array)
    colours.ApplyPreset(preset, True)
    colours.AutomaticRescaleRangeMode = "Never"
    colours.RescaleTransferFunction(low, high)
    display.SetScalarBarVisibility(view, bool(title))
    if title:
        legend = simple.GetScalarBar(colours, view)
        legend.Title, legend.ComponentTitle = title, ""
        legend.TitleColor = legend.LabelColor = [0, 0, 0]
        legend.WindowLocation, legend.Orientation = corner, "Horizontal"
        legend.ScalarBarLength = 0.25
    return display


def show_stones(view):
    particles, bonds = series("particles"), series("bonds")
    display = simple.Show(particles, view)
    display.SetRepresentationType("Point Gaussian")
    display.ShaderPreset = "Sphere"
    display.GaussianRadius = 1.0
    display.ScaleByArray, display.SetScaleArray, display.UseScaleFunction = 1, ["POINTS", "radius_m"], 0
    simple.ColorBy(display, ("POINTS", "material"))
    colours = simple.GetColorTransferFunction("material")
    colours.InterpretValuesAsCategories = 1
    run = json.loads((HERE.parent / "run.json").read_text())
    names = sorted(set(run["materials"]))  # the numbers of `material` count these
    colours.Annotations = [text for k, name in enumerate(names) for text in (str(k + 1), name)]
    kinds = [run["scene"]["materials"][name].get("kind") or name for name in names]
    colours.IndexedColors = [x for kind in kinds for x in (GANGUE if kind == "gangue" else COAL)]
    display.SetScalarBarVisibility(view, False)
    if bonds:
        display = show(view, bonds, "CELLS", "strain", "Blue Orange (divergent)", -2e-3, 2e-3)
        display.LineWidth, display.Visibility = 2, 0


def show_plate(view):
    """Returns by how much the deflection is exaggerated."""
    plate, contacts, rods = series("plate"), series("contacts"), series("rods")
    if plate is None:
        return 1.0
    scale = float(f"{WARPED_M / largest(plate, 'PointData', 'displacement_m'):.1g}")
    stress = largest(plate, "PointData", "von_mises_Pa")

    def warped(source, name):
        return simple.WarpByVector(registrationName=name, Input=source, Vectors=["POINTS", "displacement_m"],
                                   ScaleFactor=scale)

    show(view, warped(plate, "plate warped"), "POINTS", "von_mises_Pa", "Viridis (matplotlib)", 0, stress / 2,
         "von Mises stress of bending, Pa", "Lower Left Corner")
    if contacts:
        show(view, warped(contacts, "contacts warped"), "POINTS", "von_mises_with_contacts_Pa", "Viridis (matplotlib)",
             0, stress / 2).Visibility = 0
    if rods:
        force = largest(rods, "CellData", "force_N")
        axes = simple.ExtractSurface(registrationName="rod axes", Input=warped(rods, "rods warped"))
        tube = simple.Tube(registrationName="rods", Input=axes, NumberofSides=16,
                           Scalars=["POINTS", "radius_m"], VaryRadius="By Absolute Scalar", Capping=1)
        show(view, tube, "CELLS", "force_N", "Cool to Warm", -force, force, "force in the rods (pull > 0), N")
    return scale


def show_walls(view):
    walls = series("walls")
    if walls:
        display = simple.Show(walls, view)
        display.ColorArrayName = [None, ""]
        display.AmbientColor = display.DiffuseColor = [0.5, 0.55, 0.6]
        display.Opacity = 0.3


def look(view):
    """From aside, upright where the plate is tilted, and as near as shows the plate on its rods whole."""
    plate = json.loads((HERE.parent / "run.json").read_text())["scene"]["plate"]
    lean, (x, y) = math.radians(plate.get("tilt_deg", 0.0)), (side / 2 for side in plate["size_m"])
    low = -max([plate.get("thickness_m", 0.0) + rod["length_m"] for rod in plate.get("rods") or []], default=0.0)
    middle, radius = (0.0, 0.0, (low + 0.3 * max(x, y)) / 2), math.hypot(x, y, (0.3 * max(x, y) - low) / 2)

    def turned(right, back, up):
        return [math.cos(lean) * right - math.sin(lean) * up, back, math.sin(lean) * right + math.cos(lean) * up]

    view.CameraViewAngle, view.CameraViewUp, view.CameraFocalPoint = 30, turned(0, 0, 1), middle
    far = radius / math.sin(math.radians(15))
    view.CameraPosition = [m + far * t for m, t in zip(middle, turned(0.50, -0.76, 0.41), strict=True)]
    view.CenterOfRotation = middle


def main(arguments):
    simple._DisableFirstRenderCameraReset()
    view = simple.GetActiveViewOrCreate("RenderView")
    for name, value in (("UseColorPaletteForBackground", 0), ("BackgroundColorMode", "Single Color"),
                        ("Background", [1, 1, 1])):
        if hasattr(view, name):  # versions differ in these
            setattr(view, name, value)
    view.OrientationAxesVisibility = 0
    show_stones(view)
    scale = show_plate(view)
    show_walls(view)
    clock = simple.AnnotateTimeFilter(registrationName="time", Input=simple.FindSource("particles"))
    clock.Format = "{time:.5f} s" + (f", deflection x {scale:g}" if scale != 1 else "")
    text = simple.Show(clock, view)
    text.Color, text.WindowLocation = [0, 0, 0], "Upper Left Corner"
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.PlayMode = "Snap To TimeSteps"
    look(view)
    if arguments:
        times = simple.FindSource("particles").TimestepValues
        wanted = float(arguments[1]) if len(arguments) > 1 else times[-1]
        scene.AnimationTime = min(times, key=lambda t: abs(t - wanted))
        view.ViewSize = [1600, 1000]
        simple.SaveScreenshot(arguments[0], view, ImageResolution=[1600, 1000])
    else:
        simple.Render(view)


main(sys.argv[1:])
