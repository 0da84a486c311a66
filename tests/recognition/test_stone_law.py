"""The law of the stones' forces that a record and known stones teach: its parts against independent references, and what
it makes of stones that are none of those that are told."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal

from common.tables import InputError
from lab.streams.stone_kinds import ERROR, hertz, kinds, stones
from recognition.estimation.errors import RecognitionError
from recognition.estimation.posterior import drawn
from recognition.innovations.bank import IMPULSE, TIME, X, Y
from recognition.innovations.prior import TRIPLE, StonePrior
from recognition.stone_forces.forces import load_forces
from recognition.stream import heard
from recognition.stream.stone_law import (
    APART,
    BROKEN,
    CENTRE,
    DIRECTIONS,
    DROPPED,
    ERRORS,
    GANGUE,
    HOW_SLOW,
    MASS,
    OTHERS,
    SCATTERS,
    SLOW,
    UNKNOWN,
    Beliefs,
    LearntLaw,
    Told,
    USUAL_1_s,
    doubted,
)
from recognition.stream.stones import BY_LAW, Known, cautions, first_touches, learnt_table, ratio_of

COVARIANCE = np.diag(ERROR**2)


@pytest.fixture(scope="module")
def prior():
    return StonePrior(load_forces(), (0.025, 0.025), (2.0, 4.0))


def fallen(gangue, rng, size=1.0, speed=3.0, faster_coal=1.0, scatter=0.05):
    """What is heard of whole stones that follow the simulated law but for size, speed and a scatter of each."""
    law, n = load_forces(), len(gangue)
    speeds = speed * np.where(gangue, 1.0, faster_coal) * np.exp(scatter * rng.standard_normal(n))
    base = np.array([law.mean(int(g), np.array(0.025), np.array(1.0)) for g in gangue])
    return base + hertz(size * np.exp(scatter * rng.standard_normal(n)), speeds) + ERROR * rng.standard_normal((n, 3))


def told_of(x, known=None, dropped=None):
    known = np.full(len(x), UNKNOWN) if known is None else np.asarray(known)
    return Told(x, np.tile(COVARIANCE, (len(x), 1, 1)), known, np.zeros(len(x), bool) if dropped is None else dropped)


def answer(x, prior, known=None, dropped=None, rate_1_s=USUAL_1_s):
    """Interval of the ratio of the stones that are not known, and the law."""
    told = told_of(x, known, dropped)
    law = LearntLaw.of(told, prior, rate_1_s)
    odds, none = law.materials(told)
    own = (told.known == UNKNOWN) & (none < 0.5)
    table = pd.DataFrame(doubted(odds[own], 0.005)).add_prefix(BY_LAW).assign(t_s=0.1 * np.arange(own.sum()))
    return ratio_of(table), law, told


def test_density_of_a_stone_is_that_of_its_classes(prior):
    """Naively, by SciPy: whole, broken and slowed stones and lumps of either material, and what is none."""
    rng, beliefs = np.random.default_rng(1), Beliefs.of(prior)
    x = fallen(np.array([False, True, True]), rng)
    told = Told(x, np.array([k * COVARIANCE for k in (1.0, 2.0, 0.5)]), np.array([UNKNOWN, UNKNOWN, 0]),
                np.array([False, False, True]))
    z = beliefs.starts(told, rng)[:2]
    found = beliefs.log_classes(z, told)
    for k, law in enumerate(z):
        spread = sum(np.exp(2 * s) * np.outer(d, d) for s, d in zip(law[SCATTERS], DIRECTIONS, strict=False))
        lump, slowed = (sd**2 * np.outer(d, d) for sd, d in (
            (0.8, DIRECTIONS[0]), (np.exp(law[HOW_SLOW][1]), DIRECTIONS[1])))
        stones, p = 1 / (1 + np.exp(law[OTHERS])), 1 / (1 + np.exp(-law[GANGUE]))
        for i in range(3):
            slow = 0.0 if told.dropped[i] else 1 / (1 + np.exp(-law[SLOW]))
            for m in (0, 1):
                centre = law[CENTRE] + m * law[APART] + (law[DROPPED] @ DIRECTIONS[:2] if told.dropped[i] else 0)
                breaks, error = 1 / (1 + np.exp(-law[BROKEN][m])), np.exp(2 * law[ERRORS]) * told.error[i]
                naive = sum(share * multivariate_normal(mean, shape + error).pdf(x[i]) for share, mean, shape in (
                    (0.97 * (1 - slow) * (1 - breaks), centre, spread + beliefs.whole),
                    (0.97 * (1 - slow) * breaks, centre + beliefs.shift[m], spread + beliefs.broken),
                    (0.97 * slow, centre + law[HOW_SLOW][0] * DIRECTIONS[1], spread + beliefs.whole + slowed),
                    (0.03, centre, spread + beliefs.whole + lump)))
                share = (p if m else 1 - p) if i < 2 else (0.05 if m else 0.95)
                assert found[k, i, m] == pytest.approx(np.log(stones * share * naive), rel=1e-9)
            assert found[k, i, 2] == pytest.approx(np.log((1 - stones) / 216), rel=1e-9)


def test_draws_are_of_both_modes():
    """A posterior of two normal modes ten deviations apart, of which one is three times as likely and half as wide."""
    def densities(z):
        near = np.log(0.75) - 0.5 * np.sum((z / 0.5) ** 2, axis=1) - z.shape[1] * np.log(0.5)
        far = np.log(0.25) - 0.5 * np.sum((z - 5.0) ** 2, axis=1)
        return np.logaddexp(near, far)[:, None], np.zeros(len(z))

    rng = np.random.default_rng(2)
    z, worth = drawn(densities, rng.uniform(-3, 8, (20, 3)), np.eye(3), 400, rng)
    near = z.mean(axis=1) < 2.5
    assert worth > 300
    assert near.mean() == pytest.approx(0.75, abs=0.06)
    assert z[near].std() == pytest.approx(0.5, rel=0.15) and z[~near].std() == pytest.approx(1.0, rel=0.15)
    assert z[~near].mean() == pytest.approx(5.0, abs=0.2)


def test_the_wide_prior_of_the_fit_is_taken_out_again(prior):
    x, rng = prior.typical + [0.3, 1.0, -0.5], np.random.default_rng(3)
    root = rng.standard_normal((3, 3)) * 0.05
    error = root @ root.T + 1e-3 * np.eye(3)
    covariance = np.linalg.inv(np.linalg.inv(error) + prior.precision)
    fit = covariance @ (np.linalg.solve(error, x) + prior.precision @ prior.typical)
    told = Told.of(fit[None], covariance[None], prior, np.array([UNKNOWN]), np.array([False]))
    assert told.x[0] == pytest.approx(x, abs=3e-3)
    assert told.error[0] == pytest.approx(error, rel=0.01, abs=2e-6)


@pytest.mark.parametrize(("size", "faster_coal", "share"), [(0.88, 1.0, 0.35), (1.0, 1.15, 0.3), (1.1, 1.0, 0.8)])
def test_stones_that_differ_from_what_is_told(prior, size, faster_coal, share):
    """Told are 25 mm: they are 22 or 27.5, or coal is faster than gangue."""
    gangue = np.arange(40) < 40 * share
    (low, said, high), law, _ = answer(fallen(gangue, np.random.default_rng(4), size, 3.0, faster_coal), prior)
    assert abs(said - share) < 0.06 and low - 1e-9 <= share <= high + 1e-9
    assert high - low < 0.2 and law.beyond < 3.5


@pytest.mark.slow
def test_stones_that_scatter_less_than_others_are_told_apart(prior):
    """Clones from 2 to 4 m/s: duration and impulse follow from the speed, and the law finds that nothing else varies."""
    rng, gangue = np.random.default_rng(9), np.arange(60) < 40
    law = load_forces()
    base = np.array([law.mean(int(g), np.array(0.025), np.array(1.0)) for g in gangue])
    x = base + hertz(1.0, rng.uniform(2, 4, 60)) + ERROR / 2 * rng.standard_normal((60, 3))
    told = replace(told_of(x), error=np.tile(COVARIANCE / 4, (60, 1, 1)))
    p = LearntLaw.of(told, prior).probabilities(told, 0.0)[0].mean(axis=1)
    assert np.where(gangue, 1 - p, p).mean() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("larger", [1.0, 3.0])
def test_how_much_larger_errors_are_than_told_is_learnt(prior, larger):
    """Of small stones, duration and form have errors that go together; in the mean of five records."""
    along, found = np.array([0.02, 1.0, 0.0]), []
    for seed in range(14, 19):
        rng = np.random.default_rng(seed)
        x = fallen(np.arange(60) % 4 > 0, rng, scatter=0.03)
        told = replace(told_of(x + 2 * larger * rng.standard_normal((60, 1)) * along),
                       error=np.tile(COVARIANCE + 4 * np.outer(along, along), (60, 1, 1)))
        found.append(np.exp(LearntLaw.of(told, prior).laws[:, ERRORS]).mean())
    assert np.mean(found) == pytest.approx(larger, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("material", [0, 1])
def test_one_material_alone_is_told_where_one_knows_some(prior, material):
    """Without a reference it may be either: the interval holds both answers."""
    x = fallen(np.r_[np.zeros(12), np.full(30, material)] > 0, np.random.default_rng(5), 0.95, 2.7)
    low, _, high = answer(x[12:], prior)[0]
    assert low < 0.05 and high > 0.95
    (low, said, high), _, _ = answer(x, prior, np.r_[np.zeros(12, int), np.full(30, UNKNOWN)])
    assert abs(said - material) < 0.05 and high - low < 0.15


@pytest.mark.slow
def test_known_stones_of_the_other_material_are_seen(prior):
    gangue = np.r_[np.arange(15) < 2, np.arange(40) % 2 == 0]
    known = np.r_[np.zeros(15, int), np.full(40, UNKNOWN)]
    (low, said, high), law, told = answer(fallen(gangue, np.random.default_rng(6)), prior, known)
    assert law.misplaced(told) == 2
    assert low <= 0.5 <= high and abs(said - 0.5) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_coal_alone_teaches_nothing_of_gangue(seed):
    """Of a hundred coal stones whose sizes and speeds vary some look like gangue: what it is like stays as believed."""
    kind = next(k for k in kinds() if k.name == "15 to 35 mm, 2 to 4 m/s")
    coal = stones(kind, np.zeros(100) > 0, np.random.default_rng(seed))[0]
    law = LearntLaw.of(told_of(coal, np.zeros(100, int)), StonePrior(load_forces(), kind.radius_m, kind.speed_m_s))
    heavier = law.laws[:, APART] @ [-3, 0, 1]  # of one size
    assert heavier.mean() == pytest.approx(law.beliefs.apart @ [-3, 0, 1], abs=0.1)


@pytest.mark.slow
def test_some_gangue_among_many_known_coal_stones_is_seen(prior):
    gangue = np.arange(160) % 2 > 0
    gangue[:100] = np.arange(100) % 20 == 7  # said to be coal
    told = told_of(fallen(gangue, np.random.default_rng(5)), np.r_[np.zeros(100, int), np.full(60, UNKNOWN)])
    law = LearntLaw.of(told, prior)
    assert law.misplaced(told) == 5
    odds = law.materials(told)[0][100:].mean(axis=1)
    assert np.mean((odds > 0) == gangue[100:]) > 0.9


@pytest.mark.slow
def test_what_is_no_stone_and_lumps_are_told_apart(prior):
    """One four times as large, and one that is nothing known."""
    rng = np.random.default_rng(7)
    x = fallen(np.arange(40) % 2 == 0, rng)
    x[0] += hertz(4.0, 1.0)
    x[1] += [-0.6, 3.0, 1.5]
    told = told_of(x)
    law = LearntLaw.of(told, prior)
    none = law.materials(told)[1]
    assert none[0] < 0.5 < none[1] and np.sum(none > 0.5) <= 2
    mass = np.exp(law.made_of(told, 1)[0] @ MASS)
    assert mass[0] / np.median(mass[::2]) == pytest.approx(64, rel=0.25)


@pytest.mark.slow
def test_gangue_that_struck_another_stone_in_the_air_is_no_coal(prior):
    """Slowed to half its speed it pushes hardly less than coal, but is longer on the plate than a stone of coal."""
    rng, gangue = np.random.default_rng(8), np.arange(40) % 4 == 0
    x = fallen(gangue, rng, scatter=0.01)
    x[:8:4] += hertz(1.0, 0.5)
    known = np.r_[np.full(40, UNKNOWN), np.zeros(10, int), np.ones(10, int)]
    told = told_of(np.vstack([x, fallen(known[40:] == 1, rng, scatter=0.01)]), known)
    p = LearntLaw.of(told, prior).probabilities(told, 0.005)[0].mean(axis=1)
    assert np.all((p[:40] > 0.5) == gangue)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [20, 21, 22])
def test_where_many_stones_meet_gangue_that_came_down_slower_is_no_coal(seed):
    """Gangue alone, of many sizes; almost half of it has kept 0.5 to 0.9 of its speed, as is likely at 200 stones a
    second. Known stones, which fell one by one, tell nothing of that."""
    rng, gangue, known = np.random.default_rng(seed), np.arange(80) >= 10, np.repeat([0, 1, UNKNOWN], [10, 10, 60])
    x = fallen(gangue, rng, size=0.8, scatter=0.02) + hertz(np.exp(0.2 * rng.standard_normal(80)), 1.0)
    slow = 20 + np.flatnonzero(rng.random(60) < 0.45)
    x[slow] += hertz(1.0, rng.uniform(0.5, 0.9, len(slow)))
    _, said, high = answer(x, StonePrior(load_forces(), (0.015, 0.025), (2.0, 4.0)), known, known != UNKNOWN, 200.0)[0]
    assert said > 0.9 and high > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0.7, 0.45])
def test_how_slow_stones_are_that_met_in_the_air_is_learnt(prior, kept):
    """Half of the stones have kept so much of their speed: the law says so within a tenth, and all stay gangue."""
    rng, known = np.random.default_rng(30), np.repeat([0, 1, UNKNOWN], [10, 10, 60])
    x = fallen(np.arange(80) >= 10, rng, scatter=0.02)
    x[20::2] += hertz(1.0, kept * np.exp(0.05 * rng.standard_normal(30)))
    (_, said, _), law, _ = answer(x, prior, known, known != UNKNOWN, 200.0)
    assert law.laws[:, HOW_SLOW][:, 0].mean() == pytest.approx(np.log(kept), abs=0.1) and said > 0.9


@pytest.mark.slow
def test_where_no_stone_came_down_slower_few_are_taken_for_one(prior):
    """In the mean less than a quarter of the eight of sixty that are usual, although speeds scatter by 15 %."""
    told = [told_of(fallen(np.arange(60) % 2 == 0, np.random.default_rng(seed), scatter=0.15)) for seed in range(40, 44)]
    assert np.mean([LearntLaw.of(one, prior).slowed(one).sum() for one in told]) < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [10, 11, 12])
def test_coal_that_strikes_again_makes_no_gangue_of_the_rest(prior, seed):
    """Half of the stones stay whole, bounce, and come down again with the speed that a restitution leaves them: without
    a reference, coal alone stays possible."""
    rng = np.random.default_rng(seed)
    first = fallen(np.zeros(60, bool), rng, scatter=0.02)
    again = first[rng.random(60) < 0.5]
    low, _, _ = answer(np.vstack([first, again + hertz(1.0, rng.uniform(0.5, 0.9, len(again)))]), prior)[0]
    assert low < 0.1


@pytest.mark.parametrize(("radius_m", "known", "said"), [
    ((0.02, 0.03), Known(3), 0), ((0.02, 0.03), Known(), 1), ((0.01, 0.03), Known(3), 1), ((0.02, 0.04), Known(), 2)])
def test_a_ratio_that_may_be_off_says_why(prior, radius_m, known, said):
    """No stone is known; radii that the law of the stones' forces was not learnt of."""
    found = cautions(known, replace(prior, radius_m=radius_m))
    assert len(found) == said and all("may be" in one and "off" in one for one in found)
    assert ("0.0155 to 0.0338 m" in "".join(found)) == (radius_m != (0.02, 0.03))


@pytest.fixture
def twenty(prior):
    """Ten stones of coal and ten of gangue, as they are heard."""
    covariance, heard = np.zeros((6, 6)), []
    covariance[np.ix_(TRIPLE, TRIPLE)] = np.linalg.inv(np.linalg.inv(COVARIANCE) + prior.precision)
    for k, one in enumerate(fallen(np.arange(20) >= 10, np.random.default_rng(8))):
        stone = np.zeros(6)
        stone[TRIPLE], stone[TIME] = one, 1000.0 * k
        heard.append(SimpleNamespace(stone=stone, covariance=covariance, misfit=1.0))
    return heard


def test_known_stones_beside_those_of_a_record(prior, twenty):
    """The first of the record, and those of other records, of which some fell as those of the record do."""
    known = Known(2, [(twenty[5:7], 0, False), (twenty[15:18], 1, True)])
    every, told = known.beside(twenty[:4], prior)
    assert every == twenty[:4] + twenty[5:7] + twenty[15:18]
    assert told.known.tolist() == [0, 0, UNKNOWN, UNKNOWN, 0, 0, 1, 1, 1]
    assert told.dropped.tolist() == [False] * 4 + [True] * 2 + [False] * 3


def test_stones_in_a_table(prior, twenty):
    """Known stones and second touches are not in it; masses as either material are those of spheres."""
    heard = twenty
    again = SimpleNamespace(**vars(heard[3]) | {"stone": heard[3].stone - np.eye(6)[IMPULSE] + 10 * np.eye(6)[TIME]})
    elsewhere = replace_place(again, 0.1)
    assert len(first_touches([*heard[:4], again])) == 4 and len(first_touches([*heard[:4], elsewhere])) == 5
    table, checks, _ = learnt_table([*heard, again], prior, prior, Known(10), 20e3, 0.005)
    assert len(table) == 10 and (table["gangue"] > 0.5).all() and (table["unlike"] == 0).all()
    strange = SimpleNamespace(**vars(heard[15]) | {"stone": heard[15].stone - 6 * np.eye(6)[IMPULSE] + 30 * np.eye(6)[TIME]})
    assert learnt_table([*heard, strange], prior, prior, Known(10), 20e3, 0.005)[0]["unlike"].tolist() == [0.1] * 10
    assert checks["misplaced"] == 0 and checks["none"] == pytest.approx(1 / 11)
    sphere = 4 / 3 * np.pi * 0.025**3
    assert table["mass_coal_kg"].median() < table["mass_gangue_kg"].median()
    assert table["mass_gangue_kg"].median() == pytest.approx(2400 * sphere, rel=0.2)
    assert learnt_table([], prior, prior, Known(), 20e3, 0.005)[0].empty


def test_file_of_known_stones(tmp_path, monkeypatch, prior):
    """Stones of each record are of its kind; a record that is not explained is refused by its name."""
    reasons = {"a.csv": "", "b.csv": ""}
    monkeypatch.setattr(heard, "record_table", lambda file, *_: (file, Path(file).name))
    monkeypatch.setattr(heard, "channels_of", lambda table, plate, source: (None, source))
    monkeypatch.setattr(heard, "hear", lambda plate, channels, prior, values, quiet_s: SimpleNamespace(
        heard=[values, quiet_s], checks=SimpleNamespace(reason=lambda: reasons[values])))
    file = tmp_path / "known.toml"
    file.write_text('[[known]]\nrecord = "a.csv"\nkind = "coal"\n[[known]]\nrecord = "b.csv"\nkind = "gangue"\nsilence_s = 2\nalike = true')
    assert heard.read_known(file, None, prior, 1.0, None) == [(["a.csv", 0.02], 0, False), (["b.csv", 2.0], 1, True)]
    reasons["b.csv"] = "a channel's gain is off"
    with pytest.raises(RecognitionError, match="b.csv: known stones are not explained: a channel's gain"):
        heard.read_known(file, None, prior, 1.0, None)
    for wrong, said in (("coal", "known.0.kind"), ("", "known")):
        file.write_text(wrong and '[[known]]\nrecord = "a.csv"\nkind = "rock"')
        with pytest.raises(InputError, match=said):
            heard.read_known(file, None, prior, 1.0, None)


def replace_place(heard, x_m):
    stone = heard.stone.copy()
    stone[X:Y + 1] = x_m
    return SimpleNamespace(**vars(heard) | {"stone": stone})


def test_a_wider_prior_holds_what_is_told(prior):
    wide = replace(prior, speed_m_s=(3.0, 3.0)).widened()
    assert wide.radius_m == pytest.approx((0.02, 0.03125)) and wide.speed_m_s == pytest.approx((3 / 1.15, 3.45))


@pytest.mark.slow
def test_odds_are_those_of_a_share_of_one_half(prior):
    """Whatever share of gangue a law has; a known stone keeps what is known of it."""
    rng = np.random.default_rng(5)
    told = told_of(fallen(rng.random(40) < 0.3, rng), np.r_[np.zeros(10, int), np.full(30, UNKNOWN)])
    law = LearntLaw.of(told, prior)
    moved = law.laws.copy()
    moved[:, GANGUE] += 2.0
    np.testing.assert_allclose(replace(law, laws=moved).materials(told)[0], law.materials(told)[0], atol=1e-9)
