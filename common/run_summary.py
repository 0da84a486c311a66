"""What run.json says of a finished run: written by the simulation, read by everybody else.

A run that this version wrote has every key. Runs of other versions or programs may lack all but `status`,
`gangue_ratio` and `materials`, and may have more: an absent key reads as None or empty, an unknown one is kept, and a
value of the wrong type is refused by name.
"""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from common.files.whole import read_json
from common.scene.plate import Edge
from common.scene.stones import Kind
from common.tables import check


class Recorded(BaseModel):
    """A table of run.json."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True, populate_by_name=True)

    def as_json(self) -> dict[str, Any]:
        """Everything that was given, as it stands in the file."""
        return self.model_dump(by_alias=True, exclude_unset=True)


class RecordedTime(Recorded):
    anti_alias: bool = False  # runs that do not say had no filter


class RecordedStones(Recorded):
    """`[stones]` of the scene (common/scene/scene.py) as far as it is recorded."""

    count: int | None = None
    radius_m: float | None = None
    positions_m: list[list[float]] | None = None  # x, y
    speed_m_s: float | None = None
    gangue_order: list[int] | None = None
    agglomerate: dict[str, Any] | None = None


class RecordedMaterial(Recorded):
    """The elastic constants of a material or of the plate; `kind` of a material that its name does not tell."""

    kind: Kind | None = None
    density_kg_m3: float | None = None
    youngs_modulus_Pa: float | None = None
    poisson_ratio: float | None = None


class RecordedContact(Recorded):
    restitution: float | None = None


class RecordedRod(Recorded):
    place_m: list[float]  # x, y


class RecordedPlate(RecordedMaterial):
    """`[plate]` of the scene (common/scene/plate.py) as far as it is recorded."""

    size_m: list[float] | None = None
    thickness_m: float | None = None
    tilt_deg: float = 0.0
    damping_ratio: float | None = None
    max_frequency_Hz: float | None = None
    rods: list[RecordedRod] | None = None
    wall_height_m: dict[Edge, float] = {}

    @property
    def is_rigid(self) -> bool:
        """Is there a plate, and does it not bend?"""
        return self.size_m is not None and self.thickness_m is None


class RecordedScene(Recorded):
    """The scene of a run as far as it is recorded."""

    name: str | None = None
    time: RecordedTime = RecordedTime()
    stones: RecordedStones = RecordedStones()
    materials: dict[str, RecordedMaterial] = {}
    contacts: dict[str, RecordedContact] = {}
    scatter: dict[str, Any] = {}
    plate: RecordedPlate = RecordedPlate()

    def kind_of(self, material: str) -> str:
        """"coal" or "gangue", or the name of a material that says neither."""
        table = self.materials.get(material)
        return (table.kind if table is not None else None) or material


class YieldReport(Recorded):
    """Did the plate yield (dem/deck/contact.py)? Pressures by stone; bending only of a flexible plate."""

    yield_stress_Pa: float | None = None
    contact_law: str | None = None
    contact_pressure_Pa: list[float] | None = None
    smooth_stone_pressure_Pa: list[float] | None = None
    bending: dict[str, float] | None = None
    bending_at_rods: dict[str, float] | None = None
    verdict: str | None = None


class RunSummary(Recorded):
    """run.json. Lists are by stone, in their order, unless said otherwise."""

    status: str
    scene: RecordedScene = RecordedScene()
    scene_hash: str | None = None  # common.scene.scene_hash of the scene as its file gave it
    assumptions: list[str] | dict[str, Any] = []
    gangue_ratio: Annotated[float, Field(ge=0, le=1)]
    gangue_ratio_by_mass: float | None = None
    materials: Annotated[list[str], Field(min_length=1)]
    stones: dict[str, list[Any]] | None = None  # by column of stones.parquet, where the scene's scatter draws them
    versions: dict[str, str] | None = None
    seeds: list[int] | dict[str, int] | None = None  # of the packings
    deck_hash: str | None = None

    dt_s: float | None = None
    dt_limits_s: dict[str, float] | None = None  # by name (dem/deck/time_step.py)
    bond_time_s: float | None = None
    expected_error: dict[str, float] | None = None  # by numerical setting, and their sum "total"
    co_step: int | None = None
    steps: int | None = None
    n_particles: int | None = None
    n_bonds: int | None = None
    n_bonds_broken: int | None = None
    n_bonds_broken_by_agglomerate: list[int] | None = None
    n_modes: int | None = None
    fragment_size_over_subsphere: list[float | None] | None = None  # of each stone, None where bonds snap
    speed_over_critical: list[float | None] | None = None  # likewise: over that at which the stone falls apart
    plate_energy_left_out: float | None = None  # share that would belong to modes above those kept

    peak_force_N: float | None = None
    impulse_N_s: float | None = None
    momentum_change_kg_m_s: float | None = None
    rod_impulse_N_s: list[float] | None = None  # on the foot of each rod, downwards
    plate_momentum_kg_m_s: float | None = None  # at the end, upwards; these four of plates on rods alone
    rods_momentum_kg_m_s: float | None = None  # at the end, upwards
    damping_impulse_N_s: float | None = None  # which modal damping took, upwards
    momentum_missing: float | None = None  # of the impulse on the plate, at its worst time, as a share
    wall_impulse_N_s: dict[str, list[float]] | None = None  # x, y, z on each side wall, by its edge
    plate: dict[str, float] | None = None  # largest absolute value of each signal of the plate
    yield_: YieldReport | None = Field(default=None, alias="yield")
    energy: dict[str, Any] | None = None  # dem.run.energy_balance.energy_ledger
    rebound_speed_m_s: list[float] | None = None  # at the end, upwards, after gravity's work
    n_samples: int | None = None
    wall_time_s: dict[str, float] = {}  # by stage
    resumed_at_s: list[float] | None = None  # times at which a stopped run went on
    warnings: list[str] = []  # what no stone or plate can be, or the laws do not hold for (dem/deck/plausible.py)


def summary_from(content: dict[str, Any], file: str | Path) -> RunSummary:
    """Check what a run.json holds. Raises InputError, one line with file, key, value and what is allowed."""
    return check(RunSummary, content, file)


def read_summary(file: Path) -> RunSummary | None:
    """Read a run.json; None if there is no such file. Raises InputError as `summary_from`."""
    content = read_json(file)
    return None if content is None else summary_from(content, file)
