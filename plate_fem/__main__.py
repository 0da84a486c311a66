"""Command line: python -m plate_fem modes SCENE."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from common.command import Parser, listen_for_interrupt, run_command, say

if __name__ == "__main__":
    listen_for_interrupt()

if TYPE_CHECKING:
    from plate_fem.modes import PlateModes


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit code: 2, with one line on standard error, for bad input."""
    return run_command("plate_fem", lambda: _command(_parser().parse_args(arguments)))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m plate_fem", description="The plate of a scene.")
    commands = parser.add_subparsers(dest="command", required=True)
    modes = commands.add_parser("modes", help="print the natural frequencies of the scene's plate")
    modes.add_argument("scene", metavar="SCENE", type=Path, help="scene file (TOML)")
    modes.add_argument("--out", metavar="FILE", type=Path, help="also write the mode shapes to FILE (.vtu)")
    return parser


def _command(options: argparse.Namespace) -> int:
    from common.tables import InputError  # late, as all below: they take a second, and --help does not need them

    try:
        show_modes(options.scene, options.out)
    except InputError as error:
        say(str(error))
        return 2
    return 0


def show_modes(scene: Path, out: Path | None) -> None:
    """Print number, frequency (Hz) and damping ratio of each mode of a scene's plate; write the shapes to `out`.

    Raises InputError for a scene that cannot be read, or whose plate is rigid or has no `max_frequency_Hz`.
    """
    from common.cache import user_cache
    from common.output_directory import is_stamped, refuse_file
    from common.plate import read_plate
    from common.tables import InputError, refused_in
    from plate_fem.modes import plate_modes

    plate = read_plate(scene)
    if plate.model == "rigid":
        raise InputError(f"{scene}: plate.model = 'rigid': must be 'flexible' to have modes")
    if plate.max_frequency_Hz is None:
        raise InputError(f"{scene}: plate.max_frequency_Hz is missing: it must be given to list modes without stones")
    if out is not None and out.suffix != ".vtu":
        raise InputError(f"--out = {out}: the name must end in .vtu")
    if out is not None:
        refuse_file(str(out), is_stamped)
    with refused_in(scene, "plate"):
        modes = plate_modes(plate, user_cache())
    print(f"# {modes.theory} plate, {len(modes.quad)} cells, mass {modes.mass_kg:.6g} kg")
    print(f"{'mode':>5} {'Hz':>12} {'damping':>9}")
    for number, (frequency, damping) in enumerate(zip(modes.frequency_Hz, modes.damping_ratio, strict=True), 1):
        print(f"{number:5d} {frequency:12.4f} {damping:9.5f}")
    if out is not None:
        write_shapes(modes, out)


def write_shapes(modes: PlateModes, out: Path) -> None:
    """Write the mesh (.vtu) with one field of vertical displacement per mode, scaled to a largest value of one, or zero
    where rods twist below a plate at rest."""
    import meshio
    import numpy as np

    from common.files import written_whole
    from common.output_directory import stamped

    points = np.column_stack([modes.node_m, np.zeros(len(modes.node_m))])
    largest = abs(modes.shape).max(axis=0)
    shape = modes.shape / np.where(largest > 0, largest, 1.0)
    columns = zip(modes.frequency_Hz, shape.T, strict=True)
    fields = {f"mode_{j:03d}_{frequency:.1f}_Hz": column for j, (frequency, column) in enumerate(columns, 1)}
    with written_whole(out) as beside:
        meshio.Mesh(points, [("quad", modes.quad)], point_data=fields).write(beside, file_format="vtu")
        beside.write_text(stamped(beside.read_text()))


if __name__ == "__main__":
    sys.exit(main())
