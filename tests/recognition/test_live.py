"""What is heard live, against the same samples in a file; and what cannot be samples."""

import json
import os
import socket
import threading
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import resample_poly

from lab.known_truth.machine_noise import noise
from lab.known_truth.simulated import draw_stones, stream_of
from recognition.__main__ import main
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import LEAD
from recognition.stone_forces.forces import save_forces
from recognition.stream.listen import Sums
from recognition.stream.live import Live, Window, watched
from recognition.stream.recognise import Ear, RATE_Hz
from recognition.stream.stones import Known
from tests.recognition.elastic_stones import CHANNELS

RATE_2_Hz = 2 * RATE_Hz
COMPARED = ["t_s", "x_m", "y_m", "place_sd_m", "impulse_N_s", "duration_s"]


@pytest.fixture(scope="module")
def drawing(plate, histories, forces, tmp_path_factory):
    """Forty stones in two seconds at 40 kHz, and the directory with what `listen` is told."""
    here, rng = tmp_path_factory.mktemp("live"), np.random.default_rng(8)
    truth = draw_stones(histories, 40, 20.0, 0.2, 0.5, rng)
    plate.save(here / "plate.json")
    save_forces(forces, here / "law.json")
    return here, stream_of(plate, CHANNELS, histories, truth, RATE_2_Hz, 20.0, rng).values.astype("<f4"), truth


@pytest.fixture(scope="module")
def few_modes(plate, forces, tmp_path_factory):
    here = tmp_path_factory.mktemp("few")
    plate.below(400.0).save(here / "plate.json")
    save_forces(forces, here / "law.json")
    return here


@pytest.fixture(scope="module")
def names(plate):
    return [f"acc_{name}_m_s2" for name in plate.sensor_names]


def sent(values, header):
    return (json.dumps(header) + "\n").encode() + np.ascontiguousarray(values.T, dtype="<f4").tobytes()


def listened(capsys, here, record, *options):
    """Exit code, the lines of JSON, and what went wrong."""
    capsys.readouterr()
    code = main(["listen", record, "--plate", str(here / "plate.json"), "--law", str(here / "law.json"), "--radius", "0.025",
                 "0.025", "--speed", "2", "4", "--silence", "0.04", *options])
    said = capsys.readouterr()
    return code, [json.loads(line) for line in said.out.splitlines() if line.startswith("{")], said.err


def piped(capsys, here, content, *options):
    """The same of bytes on the standard input."""
    (here / "bytes").write_bytes(content)
    kept = os.dup(0)
    try:
        with (here / "bytes").open("rb") as file:
            os.dup2(file.fileno(), 0)
        return listened(capsys, here, "-", *options)
    finally:
        os.dup2(kept, 0)
        os.close(kept)


@pytest.mark.slow
def test_live_stones_are_those_of_the_file(drawing, names, capsys):
    """Over a socket, in pieces that cut frames; and the ratio over time holds the truth."""
    here, values, truth = drawing
    table = pd.DataFrame(values.T.astype(float), columns=names)
    table.insert(0, "t_s", np.arange(len(table)) / RATE_2_Hz)
    table.to_parquet(here / "record.parquet")
    assert listened(capsys, here, str(here / "record.parquet"), "--out", str(here / "out"))[0] == 0
    stones = pd.read_parquet(here / "out" / "stones.parquet")
    server = socket.create_server(("localhost", 0))
    content = sent(values / 9.80665, {"rate_Hz": RATE_2_Hz, "channels": names, "unit": "m/s^2"})

    def send():
        with server.accept()[0] as connection:
            for k in range(0, len(content), 4099):
                connection.sendall(content[k:k + 4099])

    thread = threading.Thread(target=send)
    thread.start()
    code, events, _ = listened(capsys, here, f"tcp://localhost:{server.getsockname()[1]}", "--scale", "9.80665")
    thread.join()
    assert code == 0 and events[0]["event"] == "calibrated" and events[-1]["event"] == "end"
    assert events[0]["warning"].startswith("WARNING: no stone is known")
    live = pd.DataFrame([event for event in events if event["event"] == "stone"])
    assert len(truth) - 1 <= min(len(live), len(stones))  # each list has its own law, by which one may be none
    beside = live.iloc[[int(abs(live["t_s"] - t_s).argmin()) for t_s in stones["t_s"]]]
    assert beside[COMPARED].to_numpy() == pytest.approx(stones[COMPARED].to_numpy(), rel=1e-5, abs=1e-7)
    ratios = [event for event in events if event["event"] == "ratio"]
    assert [one["t_s"] for one in ratios] == pytest.approx(np.arange(len(ratios)) / 10 + ratios[0]["t_s"])
    last = ratios[-1]
    inside = truth["t_s"].between(last["t_s"] - 1, last["t_s"])
    assert last["stones"] == live["t_s"].between(last["t_s"] - 1, last["t_s"]).sum() >= inside.sum() - 1
    inside &= truth["t_s"].map(lambda t_s: abs(live["t_s"] - t_s).min() < 1e-4)  # of those that were heard
    assert last["low"] <= truth["gangue"][inside].mean() <= last["high"]
    heard_s = {one["t_s"]: k for k, one in enumerate(events) if one["event"] == "stone"}
    assert all(heard_s[t_s] < events.index(last) for t_s in heard_s if t_s < last["t_s"])


@pytest.mark.slow
@pytest.mark.parametrize("nominal", [20_000, 40_000])
def test_stones_are_told_in_the_times_of_the_record(drawing, names, capsys, nominal):
    """A clock that is 0.08 % fast. What is about 20 kHz is not resampled."""
    here, values, truth = drawing
    values, rate_Hz = resample_poly(values, nominal, 40_000, axis=1), 1.0008 * nominal + 0.3
    table = pd.DataFrame(values.T.astype(float), columns=names)
    table.insert(0, "t_s", 5.0 + np.arange(len(table)) / rate_Hz)
    table.to_parquet(here / "fast.parquet")
    assert listened(capsys, here, str(here / "fast.parquet"), "--out", str(here / "fast"))[0] == 0
    stones = pd.read_parquet(here / "fast" / "stones.parquet")["t_s"] - 5.0
    _, events, _ = piped(capsys, here, sent(values, {"rate_Hz": rate_Hz, "channels": names}))
    for found_s in (stones, [one["t_s"] for one in events if one["event"] == "stone"]):
        assert np.median([min(abs(truth["t_s"] * nominal / rate_Hz - t_s)) for t_s in found_s]) < 1e-4


@pytest.mark.slow
def test_where_every_stone_is_known_there_is_no_ratio(drawing, names, capsys):
    here, values, _ = drawing
    table = pd.DataFrame(values.T.astype(float), columns=names)
    table.insert(0, "t_s", np.arange(len(table)) / RATE_2_Hz)
    table.to_parquet(here / "known.parquet")
    assert main(["listen", str(here / "known.parquet"), "--plate", str(here / "plate.json"), "--law", str(here / "law.json"),
                 "--radius", "0.025", "0.025", "--speed", "2", "4", "--silence", "0.04", "--out", str(here / "known"),
                 "--coal-first", "60"]) == 3
    assert capsys.readouterr().out.endswith("no ratio can be trusted: no stone was heard that is not known\n")


def test_a_terminal_shows_the_ratio_over_its_interval():
    event = {"event": "ratio", "t_s": 1.25, "stones": 7, "low": 0.1, "ratio": 0.2, "high": 0.3}
    assert watched(event) == f"     1.2 s .....=====#=====.{'.' * 34}  20% of 7 stones"
    assert watched({"event": "alarm", "t_s": 2.0}) == "     2.0 s STOP"
    assert watched({"event": "law", "t_s": 2.0, "unsafe": True}).endswith("too few known stones")
    assert watched({"event": "stone", "t_s": 2.0}) == ""
    assert watched({"event": "calibrated", "t_s": 2.0, "warning": "WARNING: x"}).endswith("calibrated WARNING: x")
    assert watched(event | {"stones": 0, "ratio": np.nan}) == ""


@pytest.mark.slow
def test_another_plate_is_said_within_three_seconds(drawing, names, capsys):
    here, values, _ = drawing
    swapped = {"rate_Hz": RATE_2_Hz, "channels": names[2:] + names[:2]}
    code, events, _ = piped(capsys, here, sent(values[:, :round(RATE_2_Hz)], swapped), "--watch")
    assert code == 3 and [one["event"] for one in events] == ["NOT EXPLAINED"]
    code, events, _ = piped(capsys, here, sent(values, swapped))
    assert code == 3 and events[-1]["event"] == "NOT EXPLAINED"
    assert next(one for one in events if one["event"] == "refused")["t_s"] < 3
    assert "ratio" not in {one["event"] for one in events}


@pytest.mark.slow
def test_what_is_clipped_above_20_kHz_is_refused_as_it_was_recorded(drawing, plate, names, capsys):
    """Resampled it is no longer level. From a stone on: by the first second, and later."""
    here, values, truth = drawing
    for after in (0, 10):
        k, most = round((truth["t_s"][after] - 0.01) * RATE_2_Hz), 0.4 * abs(values[1]).max()
        clipped = np.array(values)
        clipped[1, k:] = clipped[1, k:].clip(-most, most)
        code, events, _ = piped(capsys, here, sent(clipped, {"rate_Hz": RATE_2_Hz, "channels": names}))
        assert code == 3 and events[-1]["event"] == "REFUSED"
        assert events[-1]["refused"].startswith(f"{plate.sensor_names[1]}: clipped: ")


@pytest.mark.slow
def test_a_stream_that_ends_early_is_held_to_radii_and_speeds_too(drawing, names, capsys):
    here, values, _ = drawing
    content = sent(values[:, :round(0.7 * RATE_2_Hz)], {"rate_Hz": RATE_2_Hz, "channels": names})
    code, events, _ = piped(capsys, here, content, "--radius", "0.008", "0.01")
    assert code == 3 and "off --radius and --speed, limit 3.5" in events[-1]["not_explained"]


@pytest.mark.slow
@pytest.mark.parametrize(("cut", "said"), [
    (lambda frames: frames.tobytes()[:-3], "ends within a frame, 13 of 16 bytes"),
    (lambda frames: np.vstack([frames, np.full((1, 4), np.nan, "<f4"), frames[:9]]).tobytes(), "must be finite")])
def test_what_breaks_off_loses_no_stone_that_came_before(drawing, names, capsys, cut, said):
    """A cable that is pulled, and a sample that is none: as one frame less, and an error in place of the end."""
    here, values, truth = drawing
    last_s = truth["t_s"][truth["t_s"] > 1.2].iloc[0] + 0.003
    frames = np.ascontiguousarray(values[:, :round(last_s * RATE_2_Hz)].T)
    header = {"rate_Hz": RATE_2_Hz, "channels": names}
    whole = frames if "finite" in said else frames[:-1]
    code, events, told = piped(capsys, here, sent(whole.T, header))
    assert code == 0 and sum(one["event"] == "stone" for one in events) > 15 and not told
    code, broken, told = piped(capsys, here, sent(frames[:0].T, header) + cut(frames))
    assert code == 2 and said in told and told.count("\n") == 1
    assert [one for one in broken if one["event"] == "stone"] == [one for one in events if one["event"] == "stone"]


HEADER = {"rate_Hz": 20000, "channels": ["acc_north_m_s2"]}


@pytest.mark.parametrize(("content", "options", "said"), [
    (b"", (), "must begin with a line of JSON"),
    (b"\x00" * 200_000, (), "must begin with a line of JSON"),
    (b"[1, 2]\n", (), "must begin with a line of JSON"),
    (sent(np.zeros((1, 9)), HEADER | {"rate_Hz": "fast"}), (), "rate_Hz = 'fast'; must be a number"),
    (sent(np.zeros((1, 9)), HEADER | {"rate_Hz": 100}), (), "needs at least 20000"),
    (sent(np.zeros((1, 9)), HEADER | {"channels": ["x", "x"]}), (), "must be a list of different names"),
    (sent(np.zeros((1, 9)), HEADER | {"channels": ["attic"]}), (), "at least one of acc_north_m_s2"),
    (sent(np.zeros((1, 9)), HEADER | {"unit": "volt"}), (), "unit = 'volt'; must be one of"),
    (sent(np.zeros((1, 9)), HEADER | {"unit": ["g"]}), (), "unit = ['g']; must be one of"),
    (sent(np.zeros((2, 9)), HEADER | {"channels": ["north", "acc_north_m_s2"], "unit": "m/s^2"}), (), "must be different sensors"),
    (sent(np.zeros((1, 9)), HEADER | {"unit": "g"}), (), "standard input: acc_north_m_s2: unit = 'g'; samples are in"),
    (sent(np.zeros((1, 9)), HEADER | {"unit": "m/s²"}), (), "--silence 0.04: must be from"),
    (sent(np.r_[np.zeros(500), np.nan][None], HEADER), (), "acc_north_m_s2 at 0.025 s: every sample must be finite"),
    (sent(np.zeros((1, 9)), HEADER)[:-1], (), "ends within a frame, 3 of 4 bytes"),
    (sent(np.zeros((1, 9)), HEADER), (), "--silence 0.04: must be from 0.02 s to the length of the record"),
    (sent(np.zeros((1, 0)), HEADER), (), "--silence 0.04: must be from 0.02 s to the length of the record"),
    (sent(np.zeros((1, 9)), HEADER), ("--out", "nowhere"), "--out: must be a directory for a record"),
])
def test_what_cannot_be_samples_ends_in_one_line(few_modes, capsys, content, options, said):
    code, events, told = piped(capsys, few_modes, content, *options)
    assert code == 2 and said in told and told.count("\n") == 1 and not events


def test_a_socket_may_have_an_address_of_ipv6(few_modes, capsys):
    try:
        server = socket.create_server(("::1", 0), family=socket.AF_INET6)
    except OSError:
        pytest.skip("no IPv6 here")
    thread = threading.Thread(target=lambda: server.accept()[0].close())
    thread.start()
    code, _, told = listened(capsys, few_modes, f"tcp://[::1]:{server.getsockname()[1]}")
    thread.join()
    server.close()
    assert code == 2 and "must begin with a line of JSON" in told


def test_a_socket_that_nobody_opened_ends_in_one_line(few_modes, capsys):
    for address in ("tcp://localhost:1", "tcp://localhost", "tcp://localhost:port"):
        code, events, told = listened(capsys, few_modes, address)
        assert code == 2 and "cannot be read" in told and told.count("\n") == 1 and not events


@pytest.fixture(scope="module")
def pause(plate, histories):
    """Fifteen stones, two seconds of silence, fifteen stones; the sample where the silence begins, and the truth."""
    rng = np.random.default_rng(12)
    truth = draw_stones(histories, 30, 20.0, 0.2, 0.5, rng)
    later_s = np.where(np.arange(30) < 15, 0.0, 2.0)
    truth = truth.assign(t_s=truth["t_s"] + later_s, centre_s=truth["centre_s"] + later_s)
    values = stream_of(plate, CHANNELS, histories, truth, RATE_Hz, None, rng).values
    return values, round((truth["t_s"][14] + 0.2) * RATE_Hz), truth


def in_noise(values, begins, kind, level):
    """With white noise of 20 dB, and other noise, so many times as loud, from a sample on."""
    rng, rms = np.random.default_rng(13), np.sqrt(np.mean(values**2, axis=1, keepdims=True))
    first = rng.standard_normal(values.shape)
    other = level * (first if kind == "white" else noise(kind, values.shape, RATE_Hz, rng))
    return values + 0.1 * rms * np.where(np.arange(values.shape[1]) < begins, first, other)


def told(plate, forces, values):
    prior = StonePrior(forces, (0.025, 0.025), (2.0, 4.0))
    live = Live(Ear(plate, CHANNELS, prior, 0.04), prior, Known(), None, Window(1.0, 0.1))
    return [one for k in range(0, values.shape[1], 777) for one in live.hear(values[:, k:k + 777])], live


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "level"), [("white", 3.0), ("white", 0.3), ("mixture", 2.0)])
def test_noise_that_changes_is_learnt_in_a_pause(plate, forces, pause, kind, level):
    values, begins, truth = pause
    events, live = told(plate, forces, in_noise(values, begins, kind, level))
    (learnt,) = [one for one in events if one["event"] == "noise learnt"]
    assert begins / RATE_Hz < learnt["t_s"] < truth["t_s"][15] and (learnt["change"] > 1) == (level > 1)
    stones = pd.DataFrame([one for one in events if one["event"] == "stone"])
    off_s = stones["t_s"].map(lambda t_s: abs(truth["t_s"] - t_s).min())
    assert len(stones) >= len(truth) - 2 and off_s.max() < 1e-4 and not live.reason


@pytest.mark.slow
def test_what_is_not_learnt_makes_stones_up_or_is_refused(plate, forces, pause, monkeypatch):
    monkeypatch.setattr("recognition.stream.recognise.GAP_S", 1e3)
    values, begins, truth = pause
    events, live = told(plate, forces, in_noise(values, begins, "white", 3.0))
    assert sum(one["event"] == "stone" for one in events) > len(truth) or "refused" in {one["event"] for one in events}


@pytest.mark.slow
def test_another_plate_is_not_learnt_as_noise(plate, forces, pause):
    """Sensors that are swapped, in noise that changes: it is learnt, and no ratio is told for the rest."""
    values, begins, _ = pause
    events, live = told(plate, forces, in_noise(values, begins, "white", 3.0)[[2, 3, 0, 1]])
    names = [one["event"] for one in events]
    assert "noise learnt" in names and "unexplained" in live.reason
    assert not {"ratio", "explained"} & set(names[names.index("refused"):])


def test_silence_tells_no_gain_and_leaves_nothing_unexplained():
    quiet = np.random.default_rng(1).standard_normal((2, 20_000))
    sums = Sums.of(quiet, quiet)
    assert sums.gain.tolist() == [1.0, 1.0] and sums.unexplained == 0.0


def test_stones_that_have_left_the_window_are_forgotten_while_nothing_is_explained():
    live = object.__new__(Live)
    live.ear = SimpleNamespace(listens=True, listener=SimpleNamespace(at=round(9.05 * RATE_Hz) + LEAD))
    live.window, live.steps, live.reason = Window(1.0, 0.1), 0, "another plate"
    live.stones = [pd.DataFrame({"t_s": [t_s]}) for t_s in np.arange(90) / 10]
    assert not list(live._ratios()) and sum(map(len, live.stones)) <= 11
