"""What a deck tells the engine's fixes wrongly, or gives free flight that it does not know, is refused in one line at
`init` or before: docs/decks.md."""

import struct
import subprocess

import pytest
from decks import FREE_FLIGHT, bond_line, deck, fcc_ball, write_files

from dem.coupling.launch import ENGINE

DT = 2e-7
WEIGHT = "fix gravity unheld gravity 9.8 vector 0 0 -1\n"
PLATE = ("fix plate all wall/plate agglomerates agglomerates.txt forces forces.bin extent -1 1 -1 1 co_step 1 "
         "contact model hertz tangential history primitive type 2 zplane 0.0\n")
SIDE = PLATE.replace("plate", "side").replace("extent -1 1 -1 1 co_step 1", "every 10 box 1 1 -1 1 -1 1")
PICTURES = "fix pictures all pictures agglomerates agglomerates.txt file pictures.bin every 100\n"
FREE = (f"fix free all {FREE_FLIGHT} agglomerates agglomerates.txt gravity 9.8 down 0 0 -1 speed 3 tolerance 1e-3 every 50 "
        "unheld unheld\nthermo_modify lost ignore\n")
LEDGER = "fix ledger all ledger agglomerates agglomerates.txt every 50 file ledger.bin\n"
INSERT = """fix ball all particletemplate/sphere 15485863 atom_type 1 density constant 2000 radius constant 0.0009
fix balls all particledistribution/discrete 15485867 1 ball 1.0
region corner block 0.01 0.02 0.01 0.02 0.01 0.02 units box
fix rain all insert/pack seed 32452843 distributiontemplate balls insert_every 20 overlapcheck yes all_in yes &
    particles_in_region 3 region corner
"""


def run(directory, lines="", files=None, change=("", ""), then=""):
    """A ball of 19 bonded sub-spheres above the plate, with words of its deck and numbers of its files changed; what the
    engine says, which must end in good order."""
    body = fcc_ball(3)
    body.center_m[:, 2] += 0.004
    write_files(directory, body)
    for name, text in (files or {}).items():
        (directory / name).write_text(text((directory / name).read_text()) if callable(text) else text)
    text = deck(DT, 100, 50, bonds=bond_line(tension=1e7, shear=1e7, damping_time=1e-8), lines=lines)
    assert change[0] in text
    (directory / "deck").write_text(text.replace(*change) + then)
    return subprocess.run([str(ENGINE), "-in", "deck"], cwd=directory, capture_output=True, text=True, errors="replace",
                          timeout=60, check=False)


def assert_refused(done, *words):
    """Exit code 1 and one line of error, which has these words."""
    (line,) = [line for line in (done.stdout + done.stderr).splitlines() if "ERROR" in line]
    assert done.returncode == 1 and line.startswith("ERROR: Fix "), line
    for word in words:
        assert word in line, line


def bond(column, value, row=3):
    """The bonds with one number of a line changed."""
    def changed(text):
        rows = [line.split() for line in text.splitlines()]
        rows[row][column:column + len(value.split())] = value.split()
        return "\n".join(map(" ".join, rows)) + "\n"
    return {"bonds.txt": changed}


def test_the_deck_of_these_tests_runs(tmp_path):
    """With all that free flight knows."""
    show = "compute ke all ke\nfix mean all ave/time 1 10 10 c_ke\nfix said all print 50 hello\n"
    lines = WEIGHT + PLATE + SIDE + PICTURES + show + FREE
    done = run(tmp_path, lines.replace("c_ke", "c_ke file mean.txt"), change=("run 100\n", "run 2000\n"))
    assert done.returncode == 0, done.stdout[-1000:]
    rows = [line.split() for line in (tmp_path / "mean.txt").read_text().splitlines() if line[0] != "#"]
    assert [int(row[0]) for row in rows] == list(range(10, 2001, 10))  # also while the ball flies, and the arrays are empty
    assert float(rows[-2][1]) == 0


@pytest.mark.parametrize("line, words", [
    ("fix drag all viscous 1e-3", ["fix drag of style viscous"]),
    ("fix check all check/timestep/gran 100 0.5 0.5", ["fix check of style check/timestep/gran"]),
    ("fix push all addforce 0 0 1", ["fix push of style addforce"]),
    ("fix hold all setforce 0 0 0", ["fix hold of style setforce"]),
    ("fix ice all freeze", ["fix ice of style freeze"]),
    ("fix calm all momentum 10 linear 1 1 1", ["fix calm of style momentum"]),
    ("fix shelf all wall/gran model hertz tangential history primitive type 2 zplane -0.012",
     ["fix shelf of style wall/gran"]),
    ("fix other unheld gravity 1 vector 1 0 0", ["2 fixes gravity"]),
    ("fix again unheld nve/sphere", ["needs one fix nve/sphere"]),
    (PLATE.replace("fix plate", "fix plate2").replace("forces.bin", "forces2.bin").strip(), ["2 plates"]),
], ids=lambda value: value.split()[3] if isinstance(value, str) else "")
def test_free_flight_refuses_by_name_what_it_does_not_know(tmp_path, line, words):
    """Before and after it in the deck."""
    for where, lines in (("before", line + "\n" + FREE), ("after", FREE + line + "\n")):
        (tmp_path / where).mkdir()
        assert_refused(run(tmp_path / where, WEIGHT + PLATE + lines), "free_flight (id free)", *(words if where == "before" else []))


@pytest.mark.parametrize("change, words", [
    (("fix motion unheld", "fix motion all"), ["fix motion of style nve/sphere", "unheld"]),
    (("fix gravity unheld gravity 9.8", "fix gravity unheld gravity 5"), ["gravity"]),
    (("fix gravity unheld gravity 9.8", "variable g equal step\nfix gravity unheld gravity v_g"), ["varies"]),
    (("vector 0 0 -1", "vector 0 1 -1"), ["gravity and down"]),
    (("boundary m m m", "boundary m p m"), ["periodic"]),
    (("pair_style gran model hertz tangential history", "fix roll all property/global coefficientRollingFriction "
      "peratomtypepair 2 .1 .1 .1 .1\npair_style gran model hertz tangential history rolling_friction cdt"), ["pair_style"]),
    (("down 0 0 -1", "down 0 0 0"), ["down 0 0 0", "unit vector"]),
    (("down 0 0 -1", "down 0 0 1"), ["Z below 0"]),
    (("tolerance 1e-3", "tolerance 0"), ["tolerance 0", "above 0"]),
    (("unheld unheld", "unheld nobody"), ["unheld nobody"]),
    (("every 50 unheld", "every 50.5 unheld"), ["every 50.5", "whole number"]),
], ids=lambda value: value[1][-30:] if isinstance(value, tuple) else "")
def test_free_flight_refuses_another_motion_than_its_own(tmp_path, change, words):
    lines = (WEIGHT + FREE).replace(*change)
    assert_refused(run(tmp_path, lines, change=change if lines == WEIGHT + FREE else ("", "")), *words)


@pytest.mark.parametrize("files, words", [
    (bond(0, "-4"), ["bonds.txt, bond 4", "1 to 19"]), (bond(0, "0"), ["bond 4", "1 to 19"]),
    (bond(1, "400"), ["bond 4", "1 to 19"]), (bond(0, "1.5"), ["bond 4", "1 to 19"]),
    (bond(0, "7 7"), ["bond 4", "7 and 7"]), (bond(2, "2"), ["bond 4", "material", "1 to 1"]),
    (bond(3, "0 0 0"), ["bond 4", "length 0"]), (bond(3, "1e200"), ["bond 4", "length inf"]),
    (bond(6, "0"), ["bond 4", "radius 0"]), (bond(6, "-1e-3"), ["bond 4", "radius -0.001"]),
    (bond(7, "-1"), ["bond 4", "strength_factor -1"]), (bond(7, "nan"), ["bonds.txt", "after 3 bonds"]),
    ({"bonds.txt": lambda text: text.rsplit(" ", 1)[0]}, ["bonds.txt", "eight numbers"]),
    ({"agglomerates.txt": "10 9\n"}, ["bonds.txt, bond", "one agglomerate"]),
    ({"agglomerates.txt": "10\n"}, ["bonds.txt, bond", "1 to 10"]),
    ({"agglomerates.txt": "30\n"}, ["19 sub-spheres", "1 to 30"]),
    ({"agglomerates.txt": "-5 24\n"}, ["agglomerates.txt", "-5"]),
    ({"agglomerates.txt": "19 many\n"}, ["agglomerates.txt"]),
])
def test_files_that_make_no_sense_are_refused(tmp_path, files, words):
    assert_refused(run(tmp_path, files=files), *words)


def test_mode_shapes_of_another_version_are_refused(tmp_path):
    """Whole ones, of one mode on a grid of 4 x 4: a format whose numbers have the right lengths."""
    (tmp_path / "shapes.bin").write_bytes(struct.pack("<4q4d", 4, 4, 1, 1, -2, -2, 1, 1) + bytes(4 * 16))
    line = PLATE.replace("contact model", "shapes shapes.bin to_plate to from_plate from contact model")
    assert_refused(run(tmp_path, line), "shapes.bin is not of the format 'shapes 3'", "different versions")


@pytest.mark.parametrize("change, words", [
    ((" 10000000.0 0.0\n", " -10000000.0 0.0\n"), ["material -1e+07", "above 0"]),
    (("material 5000000000.0", "material inf"), ["material inf", "finite"]),
    (("damping_time 1e-08", "damping_time nan"), ["damping_time nan"]),
    (("damping_time 1e-08", "damping_time soon"), ["damping_time soon", "number"]),
    ((" 10000000.0 0.0\n", " 10000000.0 0.0 dilatation 1e9 1.0 1e5 fracture 4\n"), ["fracture", "p0"]),
    ((" 10000000.0 0.0\n", " 10000000.0\n"), ["material", "5 words"]),
    (("kernel auto", "kernel abacus"), ["kernel abacus"]), (("kernel auto", "colonel auto"), ["colonel", "kernel"]),
    ((" events events.csv", ""), ["lacks the keyword events"]),
    (("boundary m m m", "boundary p m m"), ["periodic"]),
    (("newton off", "newton on"), ["newton off"]), (("atom_modify map array sort 0 0", "atom_modify sort 0 0"), ["map array"]),
    (("every 50 file", "every 0 file"), ["every 0"]), (("file ledger.bin", "file ledger.bin up 0 0 0"), ["unit vector"]),
    (("extent -1 1 -1 1", "extent 1 -1 -1 1"), ["extent", "XMIN < XMAX"]), (("co_step 1 ", "co_step 0 "), ["co_step 0"]),
    (("co_step 1 ", "co_step 1 contacts c.bin every 0 "), ["every 0"]), (("co_step 1 ", "co_step 4 rows 6 "), ["rows"]),
    (("co_step 1 ", "co_step 1 yield_pressure -1 "), ["yield_pressure -1"]),
    (("zplane 0.0", "zplane 0.01"), ["zplane 0"]), (("zplane 0.0", "zcylinder 0.01 0 0"), ["zplane 0"]),
    (("contact model hertz", "contact model hooke"), ["wall/plate (id plate)", "model hertz"]),
    (("pair_style gran model hertz", "fix v all property/global characteristicVelocity scalar 2\npair_style gran model hooke"),
     ["pair_style"]),
    (("every 10 box 1 1", "every 10 box 1 2"), ["wall/side (id side)", "flat"]), (("every 10 box 1 1", "every 10 box 1 one"), ["box one"]),
    (("every 100\n", "every 100 impact 10 0\n"), ["impact", "M FIRST LAST"]),
    (("every 100\n", "every 100 impact 0 0 50\n"), ["impact 0"]),
], ids=lambda value: value[1][-30:] if isinstance(value, tuple) else "")
def test_lines_that_make_no_sense_are_refused(tmp_path, change, words):
    lines = (PLATE + SIDE + PICTURES).replace(*change)
    assert_refused(run(tmp_path, lines, change=change if lines == PLATE + SIDE + PICTURES else ("", "")), *words)


def test_the_ledger_must_see_the_forces_of_contacts_alone(tmp_path):
    assert_refused(run(tmp_path, LEDGER.replace("fix ledger", "fix late")), "(id late)", "must come before fix bonds")


@pytest.mark.parametrize("then", [
    "group one id 5\ndelete_atoms group one compress yes\nrun 100\n",
    "group one id 5\ndelete_atoms group one compress no\nrun 100\n",
    "create_atoms 1 single 0.01 0.01 0.01\nset group all density 2000\nrun 100\n",
    INSERT + "run 100\n"], ids=["deleted", "deleted, tags left", "created", "inserted"])
@pytest.mark.parametrize("bonded", [True, False])
def test_other_sub_spheres_than_those_listed_are_refused(tmp_path, then, bonded):
    """Between two runs, and from a fix within one."""
    change = ("", "") if bonded else (bond_line(tension=1e7, shear=1e7, damping_time=1e-8), "")
    assert_refused(run(tmp_path, change=change, then=then), "insert/pack" if "insert" in then else "19")
