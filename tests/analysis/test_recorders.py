"""Files of recorders and analysers: LabVIEW's, frequency responses, and real files where they are at hand."""

import gzip
import logging
from pathlib import Path

import numpy as np
import pytest

from analysis import RecordError, read_record
from analysis.files.readers import read_signals

BESIDE = [above / "shared" / "real" / "formats" for above in Path(__file__).resolve().parents]  # of the checkout
REAL = next(filter(Path.is_dir, BESIDE), None)
A = np.array([0.0, 12.5, -3.25, 7.125, -1.0, 0.5])
HEAD = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\t{}\n***End_of_Header***\t\n\t\n"
ABOUT = ("Channels\t2\t\t\nSamples\t6\t5\t\nY_Unit_Label\tg\tm/s²\t\nX_Dimension\tTime\tTime\t\n"
         "Delta_X\t0,0005\t2E-3\t\n***End_of_Header***\t\t\t\n")


def comma(number):
    return f"{number:.4f}".replace(".", ",")


def measurement(columns):
    """Of the channels `north` (6 samples) and `south` (5), with columns of times as `columns` says."""
    x = {"No": ("", "\t"), "One": ("X_Value\t", "\t"), "Multi": ("X_Value\t", "\tX_Value\t")}[columns]
    rows = [x[0].rstrip("\t") + "\tnorth" + x[1] + "south\tComment"]
    for k, value in enumerate(A):
        t = ["" if columns == "No" else comma(k * 5e-4), "\t" + comma(k * 2e-3) + "\t" if columns == "Multi" else "\t"]
        rows.append(t[0] + "\t" + comma(value) + t[1] + (comma(-value) if k < 5 else ""))
    return ABOUT + "\n".join(rows) + "\n"


@pytest.mark.parametrize("columns", ["No", "One", "Multi"])
def test_lvm(tmp_path, columns):
    file = tmp_path / "x.lvm"
    file.write_bytes((HEAD.format(columns) + measurement(columns)).replace("\n", "\r\n").encode("cp1252"))
    north, south = (read_record(file, column=name) for name in ("north", "south"))
    np.testing.assert_array_equal(north.values, A)
    np.testing.assert_array_equal(south.values, -A[:5])
    assert (north.rate_Hz, north.unit, south.rate_Hz, south.unit) == (2000.0, "g", 500.0, "m/s^2")
    with pytest.raises(RecordError, match="north, south"):
        read_record(file)
    with pytest.raises(RecordError, match="one rate and one length"):
        read_signals(file)


def test_several_measurements_of_an_lvm_file_stay_apart(tmp_path):
    file = tmp_path / "x.lvm"
    file.write_text(HEAD.format("One") + measurement("One") + "\n" + measurement("One").replace("12,5", "13,5"))
    assert [read_record(file, column=f"{k}/north").values[1] for k in (0, 1)] == [12.5, 13.5]
    with pytest.raises(RecordError, match="0/north"):
        read_record(file, column="north")


@pytest.mark.parametrize("old, new", [
    ("LabVIEW M", "M"), ("Channels\t2", "Channels\tx"), ("Channels\t2", "Channels\t9"), ("Channels", "Canals"),
    ("12,5", "oops"), ("south\t", "north\t")])
def test_broken_lvm_files_are_refused(tmp_path, old, new):
    text = HEAD.format("One") + measurement("One")
    assert old in text
    (tmp_path / "x.lvm").write_text(text.replace(old, new))
    with pytest.raises(RecordError, match="x.lvm: not a readable LVM") as error:
        read_record(tmp_path / "x.lvm", column="north")
    assert "\n" not in str(error.value)


def test_tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "x.tdms") as writer:
        writer.write_segment([
            nptdms.ChannelObject("plate", "north", A, {"wf_increment": 1 / 51200, "unit_string": "g"}),
            nptdms.ChannelObject("plate", "ai:1", -A, {"wf_increment": 1 / 51200}),
            nptdms.ChannelObject("slow", "oil", A)])
    north, south = (read_record(tmp_path / "x.tdms", column=name) for name in ("north", "plate/ai:1"))
    np.testing.assert_array_equal(north.values, A)
    np.testing.assert_array_equal(south.values, -A)
    assert (north.rate_Hz, north.unit, south.rate_Hz) == (pytest.approx(51200.0), "g", pytest.approx(51200.0))
    with pytest.raises(RecordError, match="rate"):
        read_record(tmp_path / "x.tdms", column="oil")
    (tmp_path / "x.tdms").write_bytes(b"nothing of the kind\n" * 20)
    with pytest.raises(RecordError, match="not a readable TDMS"):
        read_record(tmp_path / "x.tdms")


@pytest.mark.parametrize("text, refused", [
    ("1,5\n2,25\n-0,5\n", True), ("0,5e-3\n1,25e-3\n", True), ("Kanal 1 in g\n1,5\n2,25\n", True),
    ("1,5\n2,-25\n", False), ("1.0,5\n2.5,25\n", False), ("a,b\n1,5\n2,25\n", False), ("Kraft\n1,5\n2,25\n", False)])
def test_a_decimal_comma_is_not_taken_for_a_separator(tmp_path, text, refused):
    file = tmp_path / "x.csv"
    file.write_text(text)
    column = "Kraft" if "Kraft" in text else "a" if "a,b" in text else "0"
    if refused:
        with pytest.raises(RecordError, match="decimal comma") as error:
            read_record(file, column=column, rate_Hz=51200.0)
        assert "\n" not in str(error.value)
    else:
        first = read_record(file, column=column, rate_Hz=51200.0).values[0]
        assert first == (1.5 if "Kraft" in text else 1.0)


MASS_kg, NATURAL_1_s, DAMPING = 2.0, 2 * np.pi * 40.0, 0.05


def mobility(frequency_Hz):
    """Displacement over force of a mass on a spring."""
    w = 2 * np.pi * frequency_Hz
    return 1 / (MASS_kg * (NATURAL_1_s**2 - w**2 + 2j * DAMPING * NATURAL_1_s * w))


def uff_of(file, responses, frequency_Hz, unit="m", force="N"):
    pyuff = pytest.importorskip("pyuff")
    sets = [pyuff.prepare_58(
        binary=0, func_type=4, rsp_node=1, rsp_dir=3, ref_node=2, ref_dir=3, data=response, x=frequency_Hz, id1=name,
        rsp_ent_name="N", ref_ent_name="N", abscissa_spacing=1, ord_data_type=6, num_pts=len(frequency_Hz),
        abscissa_min=float(frequency_Hz[0]), abscissa_inc=float(frequency_Hz[1] - frequency_Hz[0]),
        ordinate_axis_units_lab=unit, orddenom_axis_units_lab=force, abscissa_axis_units_lab="Hz",
        abscissa_spec_data_type=18, ordinate_spec_data_type=8, orddenom_spec_data_type=13, z_axis_spec_data_type=0)
        for name, response in responses.items()]
    pyuff.UFF(str(file)).write_sets(sets, "add")


@pytest.mark.parametrize("form", ["uff", "txt"])
def test_a_frequency_response_is_read_as_the_impulse_response_of_a_mass_on_a_spring(tmp_path, form):
    frequency_Hz, file = np.arange(4001) * 0.5, tmp_path / f"x.{form}"
    response = mobility(frequency_Hz)
    if form == "uff":
        uff_of(file, {"mass": response}, frequency_Hz)
    else:
        rows = "".join(f"{f:.6e}\t {r.real:.9e}\t{r.imag:.9e}\r\n" for f, r in zip(frequency_Hz, response, strict=True))
        head = "Units: Ratio\r\n\r\nFrequency\t Real\t Imaginary\r\n\r\nUnits:\r\nHz\t(mm)(N)\t \r\n"
        file.write_bytes((head + rows).encode())
    record = read_record(file)
    assert (record.rate_Hz, record.values.size) == (pytest.approx(4000.0), 8000)
    assert record.unit == ("m/N/s" if form == "uff" else "mm/N/s")
    damped_1_s = NATURAL_1_s * np.sqrt(1 - DAMPING**2)
    exact = np.exp(-DAMPING * NATURAL_1_s * record.t_s) * np.sin(damped_1_s * record.t_s) / (MASS_kg * damped_1_s)
    beyond = 1 / (np.pi * MASS_kg * 2 * np.pi * frequency_Hz[-1])  # that frequencies above the last would add, at most
    np.testing.assert_allclose(record.values, exact, atol=1.02 * beyond)


@pytest.mark.parametrize("code, labels, unit", [
    (None, ("mm/s2", "N"), "mm/s^2/N/s"), (1, ("NONE", "NONE"), "m/N/s"), (5, ("NONE", "NONE"), "1/s"),
    (None, ("NONE", "NONE"), "1/s")])
def test_units_without_a_label_are_those_of_the_quantity_in_si_where_the_file_says_so(tmp_path, code, labels, unit):
    pyuff, frequency_Hz = pytest.importorskip("pyuff"), np.arange(9.0)
    if code:
        one = pyuff.prepare_164(units_code=code, units_description="x", temp_mode=1, length=1.0, force=1.0, temp=1.0,
                                temp_offset=0.0)
        pyuff.UFF(str(tmp_path / "x.uff")).write_sets(one, "add")
    uff_of(tmp_path / "x.uff", {"mass": mobility(frequency_Hz)}, frequency_Hz, *labels)
    assert read_record(tmp_path / "x.uff").unit == unit


def test_a_frequency_response_that_does_not_begin_at_zero_is_refused(tmp_path):
    uff_of(tmp_path / "x.uff", {"mass": mobility(np.arange(20, 100.0))}, np.arange(20, 100.0))
    with pytest.raises(RecordError, match="from 0 Hz on"):
        read_record(tmp_path / "x.uff")


@pytest.mark.skipif(REAL is None, reason="real files are not at hand")
@pytest.mark.parametrize("name, column, rate_Hz, unit, size", [
    ("shaker_and_shock.lvm", "accelerometer_board", 1 / 0.000586, "s", 12375),
    ("shaker_and_shock.lvm", "excitation_shock", 1 / 0.000606, "s", 13216),
    ("uff58_ascii.uff", None, 65536.0, "Pa", 79292), ("uff58_binary.uff", "Mic 01.0Scalar", 65536.0, "Pa", 79292),
    ("beam_frf.txt", None, 2000.0, "m/s^2/N/s", 102400)])
def test_real_files(tmp_path, caplog, name, column, rate_Hz, unit, size):
    file = REAL / name
    if not file.exists():
        file = tmp_path / name
        file.write_bytes(gzip.decompress((REAL / f"{name}.gz").read_bytes()))
    caplog.set_level(logging.WARNING)
    record = read_record(file, column=column)
    assert (record.rate_Hz, record.unit, record.values.size) == (pytest.approx(rate_Hz, rel=1e-6), unit, size)
    assert ("rises by 0.000605 s" in caplog.text) == name.endswith("lvm")  # its header contradicts its channel of times
