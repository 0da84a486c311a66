"""Stones one by one from a stream: the parts against independent references, and the whole on a plate known exactly."""


import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal

from common.scene.plate import read_plate
from recognition.__main__ import main
from recognition.estimation.errors import NotRecognised, RecognitionError
from recognition.innovations.bank import FIT_LAGS, LAGS, TIME, Bank
from recognition.innovations.prior import StonePrior
from recognition.innovations.signatures import Channels
from recognition.innovations.whitening import Whitening
from recognition.plate.plate_model import PlateModel
from recognition.stone_forces.forces import load_forces, save_forces
from recognition.stream.checks import Checks, together, without_offset_and_hum
from recognition.stream.fit import Window
from recognition.stream.listen import KEPT, PART, Listener
from recognition.stream.recognise import RATE_Hz, channels_of, recognise_stream
from recognition.stream.search import Dictionary
from recognition.stream.stone_law import LearntLaw, Told
from recognition.stream.stones import missed_of, ratio_of
from tests.recognition.elastic_stones import CHANNELS, elastic_stone, surely_told, white


def test_law_of_elastic_spheres(forces):
    """Other sizes and speeds than those of the fit follow Hertz' law: the impulse is 2 m v."""
    for gangue in (False, True):
        stone = elastic_stone(gangue, 0.018, 2.9)
        impulse, _, duration = stone.moments()
        mean = forces.mean(int(gangue), np.array(0.018), np.array(2.9))
        assert np.exp(mean[[0, 2]]) == pytest.approx([duration, impulse], rel=0.01)
        assert impulse == pytest.approx(2 * stone.mass_kg * 2.9, rel=0.01)


def test_a_reason_names_the_channel_and_gives_limits_as_it_gives_values():
    found = Checks(unexplained=0.4, gain=np.array([1.02, 0.7, 1.05]), together=0.0, change=2.0, unheard=0.0, beyond=4.0)
    assert found.reason() == (
        "40% of what happened is unexplained, limit 8%; a channel's gain is off by 30%, that of channel 2, limit 10%; the "
        "stones are 4.0 standard deviations off --radius and --speed, limit 3.5; the beginning is not quiet, or its noise "
        "changes, limit 1.8")


def test_file_of_the_law(forces, tmp_path):
    save_forces(forces, tmp_path / "law.json")
    again = load_forces(tmp_path / "law.json")
    assert all(np.array_equal(getattr(again, name), getattr(forces, name)) for name in ("form", "whole", "scatter"))
    (tmp_path / "law.json").write_text("{}")
    with pytest.raises(RecognitionError, match="law.json"):
        load_forces(tmp_path / "law.json")
    with pytest.raises(RecognitionError, match="no law"):
        load_forces(tmp_path / "none.json")
    assert load_forces().density_kg_m3 == pytest.approx([1380, 2400])


def test_stones_of_a_stream(heard):
    stream, found = heard
    truth, stones = stream.truth, found.stones
    assert len(stones) == len(truth)
    assert np.abs(stones["t_s"] - truth["t_s"]).max() < 50e-6
    assert np.hypot(stones["x_m"] - truth["x_m"], stones["y_m"] - truth["y_m"]).max() < 0.01
    assert surely_told(stones, truth) >= 9
    assert stones["impulse_N_s"].to_numpy() == pytest.approx(truth["impulse_N_s"].to_numpy(), rel=0.1)
    low, _, high = ratio_of(stones)
    assert low <= truth["gangue"].mean() <= high
    assert found.refused == "" and found.hearing.tapped


@pytest.mark.slow
def test_another_plate_is_refused(heard, plate, forces):
    """The record of one plate, heard with sensors that are not where they are said to be."""
    stream, _ = heard
    swapped = Channels((2, 3, 0, 1))
    found = recognise_stream(plate, swapped, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), stream.values)
    assert "unexplained" in found.refused


@pytest.mark.parametrize(("change", "said"), [(lambda v: v * np.array([[1.0], [1e-3], [1.0], [1.0]]), "west: dead"),
                                              (lambda v: np.clip(v, -0.3 * v.max(), 0.3 * v.max()), "clipped")])
def test_a_faulty_channel_is_refused(heard, plate, forces, change, said):
    with pytest.raises(NotRecognised, match=said):
        recognise_stream(plate, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), change(heard[0].values))


@pytest.mark.parametrize("rate_Hz", [20e3, 25e3, 51.2e3])
def test_a_clipped_record_of_any_rate_is_refused(heard, plate, rate_Hz):
    """Its level tops are no longer level once it is at the rate of listening."""
    values = heard[0].values
    t_s = np.arange(0, values.shape[1] / RATE_Hz - 1e-3, 1 / rate_Hz)
    names = [f"acc_{name}_m_s2" for name in plate.sensor_names]
    table = pd.DataFrame({name: np.interp(t_s, np.arange(values.shape[1]) / RATE_Hz, one)
                          for name, one in zip(names, values, strict=True)}).clip(-0.3 * values.max(), 0.3 * values.max())
    with pytest.raises(NotRecognised, match="clipped"):
        channels_of(table.assign(t_s=t_s), plate, "record")


@pytest.mark.slow
def test_stones_of_another_size_are_heard(heard, plate, forces):
    """Stones of 25 mm that are said to have 21: the record says otherwise, and the answer stays."""
    stream, _ = heard
    found = recognise_stream(plate, CHANNELS, StonePrior(forces, (0.021, 0.021), (2.0, 4.0)), stream.values)
    assert len(found.stones) == len(stream.truth) and found.refused == ""
    assert surely_told(found.stones, stream.truth) >= 8


@pytest.mark.slow
def test_stones_too_weak_to_be_heard_are_told(heard, plate, forces):
    """Of stones from 3 to 30 mm some are lost, which may be any share of gangue."""
    stream, found = heard
    assert found.checks.unheard < 1e-3
    found = recognise_stream(plate, CHANNELS, StonePrior(forces, (0.003, 0.03), (2.0, 4.0)), stream.values)
    assert "too weak to be heard" in found.refused and 0.1 < found.checks.unheard < 0.4


def test_share_of_stones_that_arrive_at_once():
    """Against every pair of 300 arrivals in a second, and what Poisson's law says of stones that do not."""
    t_s = np.random.default_rng(6).uniform(0, 1, 300)
    apart = np.abs(t_s[:, None] - t_s) + np.eye(300)
    assert together(t_s) == np.mean(apart.min(axis=1) < 0.2e-3)
    assert together(t_s) == pytest.approx(1 - np.exp(-2 * 300 * 0.2e-3), abs=0.06)
    assert together(np.array([0.1, 0.10005, 0.2])) == pytest.approx(2 / 3)
    assert together(np.zeros(0)) == together(np.zeros(1)) == 0.0


def test_missed_stones_widen_the_interval():
    """The same stones a thousand times as fast: of two one arrives with another, and the interval says so. Of those
    that are missed the odds of gangue are 0.3 times as large, 9.5 of 20; here gangue weighs twice as much."""
    stones = pd.DataFrame({"t_s": 0.1 * np.arange(40), "gangue": np.repeat([0.0, 1.0], [10, 30]), "mass_coal_kg": 1.0,
                           "mass_gangue_kg": 2.0, "mass_coal_sd_kg": 1e-9, "mass_gangue_sd_kg": 1e-9})
    for by_mass, ratio, missed in ((False, 0.75, 39.5 / 60), (True, 6 / 7, 79 / 99.5)):
        assert ratio_of(stones, by_mass) == pytest.approx((ratio,) * 3, abs=0.01)
        low, middle, high = ratio_of(stones.assign(t_s=stones["t_s"] / 1000), by_mass)
        assert middle == pytest.approx(missed, abs=0.01)
        assert low < missed - 0.03 and high > missed + 0.03


@pytest.mark.slow
def test_interval_where_the_weaker_of_two_is_lost(monkeypatch):
    """Two hundred stones, 400 a second, of sure material: of two within 0.2 ms the weaker is lost, and coal pushes 0.6
    times as hard, of radii that scatter by 10 %. The interval holds the ratio of all; with missed stones alike it does
    not."""
    rng = np.random.default_rng(11)
    inside, off = {0.3: [], 1.0: []}, {0.3: [], 1.0: []}
    for _ in range(200):
        t_s, gangue = np.cumsum(rng.exponential(1 / 400, 200)), rng.random(200) < rng.uniform(0.2, 0.8)
        impulse = np.where(gangue, 1.0, 0.6) * np.exp(0.3 * rng.standard_normal(200))
        before = np.flatnonzero(np.diff(t_s) < 0.2e-3)
        lost = np.where(impulse[before] < impulse[before + 1], before, before + 1)
        stones = pd.DataFrame({"t_s": t_s, "gangue": np.where(gangue, 1.0, 0.0)}).drop(index=lost)
        for odds in inside:
            monkeypatch.setattr("recognition.stream.stones.MISSED_ODDS", odds)
            low, middle, high = ratio_of(stones)
            inside[odds].append(low <= gangue.mean() <= high)
            off[odds].append(middle - gangue.mean())
    assert 0.85 <= np.mean(inside[0.3]) <= 0.95 and np.mean(inside[1.0]) < 0.7
    assert abs(np.mean(off[0.3])) < 0.005 and np.mean(off[1.0]) > 0.01


def test_where_stones_met_others_some_are_missed():
    """Of ten in a second none arrives with another, but where all came down slower some more did that nobody heard."""
    stones = pd.DataFrame({"t_s": 0.1 * np.arange(10), "gangue": 1.0, "again": 0.5})
    assert missed_of(stones.drop(columns="again")) == pytest.approx(0, abs=0.03)
    assert missed_of(stones) == pytest.approx(0.7, abs=0.03)


def test_interval_where_many_touches_are_none_by_the_law(monkeypatch):
    """Thirty stones of sure material, and thirty touches that are none by the law, of which as many as a coin says are
    stones like the others: the interval holds the ratio of all stones, that of those which are surely told does not."""
    monkeypatch.setattr("recognition.stream.stones.MISSED_ODDS", 1.0)
    rng = np.random.default_rng(9)
    inside = {0.5: [], 0.0: []}
    for _ in range(200):
        share, count = rng.random(), 30 + rng.binomial(30, 0.5)
        gangue = rng.random(count) < share
        stones = pd.DataFrame({"t_s": 10.0 * np.arange(30), "gangue": np.where(gangue[:30], 1.0, 0.0), "unlike": 1.0})
        for counted, held in inside.items():
            monkeypatch.setattr("recognition.stream.stones.UNLIKE", counted)
            low, _, high = ratio_of(stones)
            held.append(low - 1e-9 <= gangue.mean() <= high + 1e-9)
    assert 0.85 <= np.mean(inside[0.5]) <= 0.96 and np.mean(inside[0.0]) < 0.2


def test_a_stone_that_may_have_touched_before_counts_less(monkeypatch):
    """Of 30 touches of gangue 10 are second ones, which takes their mass away as well; where all may be, some counts."""
    monkeypatch.setattr("recognition.stream.stones.LOST", 0.0)  # what else such stones tell
    stones = pd.DataFrame({"t_s": 0.1 * np.arange(40), "gangue": np.repeat([0.0, 1.0], [10, 30]), "mass_coal_kg": 1.0,
                           "mass_gangue_kg": 2.0, "mass_coal_sd_kg": 1e-9, "mass_gangue_sd_kg": 1e-9})
    sure, half = np.repeat([0.0, 1.0], [30, 10]), np.repeat([0.0, 0.5], [20, 20])
    for by_mass, right in ((False, 2 / 3), (True, 0.8)):
        assert ratio_of(stones.assign(again=sure), by_mass) == pytest.approx((right,) * 3, abs=0.01)
        low, middle, high = ratio_of(stones.assign(again=half), by_mass)
        assert low < right < high and middle == pytest.approx(right, abs=0.01) and high - low > 0.03
    assert ratio_of(stones[20:22].assign(again=1.0)) == pytest.approx((1, 1, 1), abs=0.01)


@pytest.mark.slow
def test_touches_of_stones_that_came_down_slower_may_be_second_ones(forces):
    """Sixty stones, of which twelve come down once more with 0.6 of their speed."""
    prior, rng = StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), np.random.default_rng(15)
    base = forces.mean(0, np.array(0.025), np.array(3.0)) + 0.02 * rng.standard_normal((60, 3))
    x = np.vstack([base, base[:12] + np.log(0.6) * np.array([-0.2, 0.0, 1.0])])
    known = np.r_[np.zeros(20, int), np.full(52, -1)]
    told = Told(x, np.tile(np.diag([4e-4, 0.04, 4e-4]), (72, 1, 1)), known, np.zeros(72, bool))
    slowed = LearntLaw.of(told, prior).slowed(told)
    assert slowed[60:].mean() > 0.9 and slowed[:60].mean() < 0.1


def test_interval_of_stones_that_tell_nothing():
    """Any ratio is as likely as any other, by number and, where all weigh alike, by mass; none of no stones."""
    stones = pd.DataFrame({"t_s": 10.0 * np.arange(60), "gangue": np.full(60, 0.5), "mass_gangue_kg": 0.1, "mass_coal_kg": 0.1,
                           "mass_gangue_sd_kg": 0.0, "mass_coal_sd_kg": 0.0})
    for by_mass in (False, True):
        assert ratio_of(stones, by_mass) == pytest.approx((0.05, 0.5, 0.95), abs=0.05)
    assert np.isnan(ratio_of(stones.iloc[:0])).all()


@pytest.mark.slow
def test_interval_holds_as_often_as_it_says():
    """Sets of 60 stones of any ratio, told by a number that is normal about 0 or 1 with deviation 0.8: that of one stone in
    four is nearer to the other material. The mean of their probabilities is 18 points off, the answer 7."""
    rng = np.random.default_rng(8)
    off, inside, naive = [], [], []
    for _ in range(300):
        truth = rng.random(60) < rng.random()
        told = truth + 0.8 * rng.standard_normal(60)
        stones = pd.DataFrame({"t_s": 10.0 * np.arange(60), "gangue": 1 / (1 + np.exp((0.5 - told) / 0.8**2))})
        low, middle, high = ratio_of(stones)
        off.append(middle - truth.mean())
        naive.append(stones["gangue"].mean() - truth.mean())
        inside.append(low <= truth.mean() <= high)
    assert 0.85 <= np.mean(inside) <= 0.95
    assert np.mean(np.abs(off)) < 0.7 * np.mean(np.abs(naive))


def test_offset_and_hum_are_taken_away():
    t_s = np.arange(20000) / RATE_Hz
    ringing = np.array([np.sin(2 * np.pi * 300 * t_s), np.cos(2 * np.pi * 700 * t_s)])
    dirty = ringing + 3.0 + 0.5 * np.sin(2 * np.pi * 50 * t_s + 0.4)
    assert np.abs(without_offset_and_hum(dirty, RATE_Hz) - ringing).max() < 1e-3


def test_a_plate_known_too_low_is_refused(heard, forces):
    low = PlateModel.from_scene(read_plate("scenes/single.toml"), 6000.0)
    with pytest.raises(RecognitionError, match="modes up to 6000"):
        recognise_stream(low, CHANNELS, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), heard[0].values)


def test_times_are_those_of_the_centres(heard):
    stream, found = heard
    centres = np.array([h.stone[TIME] for h in found.hearing.heard]) / RATE_Hz
    assert np.abs(np.sort(centres) - stream.truth["centre_s"]).max() < 20e-6


@pytest.mark.parametrize(("change", "options", "said"), [
    (lambda t: t.iloc[::2], (), "needs at least 20000"),
    (lambda t: t.drop(columns="acc_north_m_s2"), (), "at least one of acc_north_m_s2"),
    (lambda t: t.assign(acc_north_m_s2=np.nan), (), "every sample must be finite"),
    (lambda t: t, ("--radius", "0.03", "0.02"), "lower first"),
    (lambda t: t, ("--radius", "25", "25"), "--radius 25 25: must be two numbers above 0, below 1 m"),
    (lambda t: t, ("--speed", "200", "400"), "above 0, below 100"),
    (lambda t: t, ("--step", "0"), "must be a time, at least 0.001 s"),
    (lambda t: t, ("--step", "10"), "--step 10: leads to 0 ratios over time; must lead to 1 to 100000"),
    (lambda t: t, ("--coal-first", "-1"), "must be a number of stones"),
    (lambda t: t, ("--stop-above", "200"), "must be from 2 to 98 %"),
    (lambda t: t, ("--false-alarms-per-hour", "5"), "goes with --stop-above"),
    (lambda t: t, ("--law", "none.json"), "none.json: no law"),
    (lambda t: t, ("--known", "none.toml"), "none.toml"),
    (lambda t: t, ("--silence", "1"), "record.parquet: 0.2 s long; must be longer than its quiet beginning, --silence 1"),
    (lambda t: t[:1000], ("--silence", "0.05"), "0.05 s long; must be longer than its quiet beginning, --silence 0.05"),
    (lambda t: t, ("--silence", "nan"), "from 0.02 s to the length of the record"),
])
def test_bad_input_of_the_command(plate, tmp_path, capsys, change, options, said):
    table = pd.DataFrame({"t_s": np.arange(4000) / RATE_Hz, "acc_north_m_s2": np.sin(np.arange(4000.0))})
    change(table).to_parquet(tmp_path / "record.parquet")
    plate.below(400.0).save(tmp_path / "plate.json")
    words = ["listen", str(tmp_path / "record.parquet"), "--plate", str(tmp_path / "plate.json"), "--out",
             str(tmp_path / "out"), "--radius", "0.025", "0.025", "--speed", "2", "4", *options]
    assert main(words) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def bank(plate, forces):
    return Bank.of(plate, CHANNELS, forces, Whitening.of(plate, CHANNELS, RATE_Hz, white(np.ones(4)), np.full(4, 10.0)),
                   RATE_Hz)


@pytest.mark.parametrize("temper", [1.0, 2.5])
def test_cost_of_a_fit_is_that_of_normal_noise_and_prior(bank, forces, temper):
    """Two stones that overlap: the chi-square of what they leave over twice the temper, the prior of each, and the
    slopes of both."""
    prior, rng = StonePrior(forces, (0.02, 0.03), (2.0, 4.0)), np.random.default_rng(7)
    stones = np.array([[40.3, 0, 0.05, -0.07, 0.4, 0], [47.6, 0, -0.12, 0.02, -0.3, 0]])
    stones[:, [1, 5]] = prior.typical[[0, 2]] + 0.05 * rng.standard_normal((2, 2))
    window = Window(bank, prior, 3 * rng.standard_normal((4, 120)), 10, temper)
    found = window.at(stones)

    def left(stones):
        values = np.pad(window.values, ((0, 0), (0, FIT_LAGS)))
        for stone in stones:
            first, rows = bank.signature(stone)
            values[:, first - 10:first - 10 + FIT_LAGS] -= rows[0].reshape(FIT_LAGS, 4).T
        return values[:, :120]

    law = multivariate_normal(prior.typical, np.linalg.inv(prior.precision))
    naive = np.sum(left(stones) ** 2) / (2 * temper) - sum(
        law.logpdf(stone[[1, 4, 5]]) + 1.5 * np.log(2 * np.pi) for stone in stones)
    assert found.cost == pytest.approx(naive, rel=1e-6)
    assert window.residual(stones) == pytest.approx(left(stones), abs=1e-6)
    slopes = np.zeros((12, 4 * 120))
    for k, step in enumerate(2 * [1e-2, 1e-3, 1e-4, 1e-4, 1e-2, 1e-3]):
        up, down = (stones + s * step * np.eye(12)[k].reshape(2, 6) for s in (1, -1))
        slopes[k] = (left(down) - left(up)).ravel() / (2 * step)
        slope = (window.at(up).cost - window.at(down).cost) / (2 * step)
        assert slope == pytest.approx(found.slope[k], rel=0.03, abs=0.01 * np.abs(found.slope).max())
    expected = slopes @ slopes.T / temper
    for start in (0, 6):
        at = start + np.array([1, 4, 5])
        expected[np.ix_(at, at)] += prior.precision
    size = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    assert np.abs(found.curvature - expected).max() <= 0.03 * size.max()
    assert np.abs((found.curvature - expected) / size).max() < 0.03


def test_a_part_is_hopeless_by_all_that_came_since_the_last_check(bank, forces):
    """Stones that are explained, most of them in samples that are kept no more, and then a little that is not."""
    listener = Listener(bank, StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), None)
    noise = np.random.default_rng(7).standard_normal((bank.channels, PART + 2 * KEPT))
    listener.left = noise + 3.0 * (np.arange(noise.shape[1]) > PART + 100)  # what no stone explains
    listener.whole = listener.left + 20.0 * (np.arange(noise.shape[1]) % 400 < 20) * (np.arange(noise.shape[1]) < PART)
    listener.at = listener.end = noise.shape[1]
    listener._forget()
    assert listener.first == PART and listener.sums(PART, listener.end).unexplained > 0.4
    assert not listener._hopeless(listener.end)
    listener.left = listener.whole = 10 * noise
    listener.checked = PART
    assert listener._hopeless(listener.end)


def test_a_stone_in_three_times_the_noise_is_known_a_third_as_well(bank, forces):
    """The fit to it takes the misfit as noise, against one that takes the noise for that of the sensors."""
    prior, rng = StonePrior(forces, (0.02, 0.03), (2.0, 4.0)), np.random.default_rng(7)
    stone = np.array([[40.3, prior.typical[0], 0.05, -0.07, 0.4, prior.typical[2]]])
    first, rows = bank.signature(stone[0])
    values = 3 * rng.standard_normal((4, 120))
    values[:, first:first + FIT_LAGS] += rows[0].reshape(FIT_LAGS, 4).T
    window = Window(bank, prior, values, 0)
    fit = window.fit(stone)
    heard = Listener(bank, prior, None)._judged(window, fit)[1]
    too_sure = np.linalg.inv(fit.curvature)[TIME, TIME]
    assert heard.misfit == pytest.approx(9, rel=0.2)
    assert heard.covariance[TIME, TIME] == pytest.approx(9 * too_sure, rel=0.25)


def test_a_weak_stone_before_a_strong_one_is_heard(plate, forces):
    """It has a 25th of the other's energy, 2 ms before."""
    prior, rng = StonePrior(forces, (0.025, 0.025), (2.0, 4.0)), np.random.default_rng(7)
    whitening = Whitening.of(plate, CHANNELS, RATE_Hz, white(np.full(4, 140.0)), np.ones(4))
    bank = Bank.of(plate, CHANNELS, forces, whitening, RATE_Hz)
    values = rng.standard_normal((4, 600))
    for at, place, energy in ((100.4, (0.05, -0.07), 2_000.0), (140.7, (-0.12, 0.02), 50_000.0)):
        first, rows = bank.whole(np.array([at, prior.typical[0], *place, 0.0, prior.typical[2]]))
        values[:, first:first + LAGS] += rows * np.sqrt(energy / np.sum(rows**2))
    found = Listener(bank, prior, Dictionary.of(bank, prior)).hear(values, ended=True)
    assert [h.stone[TIME] for h in found] == pytest.approx([100.4, 140.7], abs=0.3)
