"""Whatever a model file says: a ratio, a reason, or one line; it never runs code."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from analysis import read_sweep
from common.files.whole import SEAL, seal
from recognition import Model
from recognition.__main__ import main
from recognition.physics.arrangement_likelihood import ArrangementModel, ExpectedMisfit
from recognition.physics.arrangement_method import ArrangementLikelihood
from recognition.physics.force_law import ForceLaw
from tests.analysis.synthetic import write_sweep
from tests.fuzz.mutations import fuzz, many, mutated, outcome


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A model as data, and a run that it can recognise."""
    runs = tmp_path_factory.mktemp("runs") / "paper"
    write_sweep(runs)
    sweep = read_sweep(runs).runs
    model = Model.fit(sweep)
    model.methods["arrangement_likelihood"] = _arrangements(ArrangementLikelihood().prepare(sweep[3].signals))
    model.save(runs / "model.json")
    return json.loads((runs / "model.json").read_text()), runs / "ratio_030"


def _arrangements(record):
    """These runs have no fast stream to learn from: numbers at random, which fit the record."""
    method, rng, (channels, samples) = ArrangementLikelihood(), np.random.default_rng(0), record.signals.shape
    scale = np.sqrt(np.mean(record.signals**2, axis=1))
    hat = rng.standard_normal((channels, samples + 64, 3))
    method.model_ = ArrangementModel(record.names, scale, np.full(channels, 0.1), 1e-5, 1, samples, hat, 2,
                                     ForceLaw(rng.standard_normal((2, 4)), rng.standard_normal((2, 2, 2)),
                                              np.tile(np.eye(2), (2, 1, 1)), np.eye(4), 3.0), [], "{}",
                                     np.zeros((3, 2)), 0.0, 0.0, False, 2.0, 4.0)
    method.expected_ = ExpectedMisfit(np.array([0.1, 1.0]), np.ones(2))
    method.limits_, method.error_ = np.ones(2), 0.1
    return method


def check(text, run):
    here = Path(tempfile.mkdtemp())
    try:
        file = here / "model.json"
        file.write_bytes(text)
        code, errors = outcome(main, ["recognise", str(run), "--model", str(file)])
        # 3: the record is outside of what the changed model was calibrated for
        assert code in (0, 3) and not errors or code == 2 and errors.count("\n") == 1, (code, errors)
        if code != 2:
            answers = Model.load(file).recognise(read_sweep(run.parent).runs[3].signals)
            assert all(a.reason or np.isfinite(a.ratio) for a in answers.values())
        assert [p.name for p in here.iterdir()] == ["model.json"]
    finally:
        shutil.rmtree(here)


def sealed(data):
    """What somebody gives who knows how the hash is made: beyond it, the numbers must be judged."""
    try:
        return seal({key: value for key, value in data.items() if key != SEAL})
    except (TypeError, ValueError):
        return data


def models(data):
    """A model with values changed, or with bytes changed or cut off."""
    changed = mutated(data).map(lambda d: json.dumps(sealed(d), default=str).encode())

    @st.composite
    def broken(draw):
        raw = bytearray(json.dumps(data).encode())
        for _ in range(draw(st.integers(1, 3))):
            raw[draw(st.integers(0, len(raw) - 1))] = draw(st.integers(0, 255))
        return bytes(raw[: draw(st.sampled_from([len(raw), len(raw) // 2, 1, 0]))])

    return changed | changed | changed | broken()


def test_some_models(fitted):
    data, run = fitted
    fuzz(lambda text: check(text, run), models(data), 30)


@pytest.mark.validate
def test_many_models(fitted):
    data, run = fitted
    fuzz(lambda text: check(text, run), models(data), many("MODELS", 2000))


def test_a_pickle_is_not_loaded(fitted, tmp_path):
    """The classic attack: a file that runs code when it is unpickled."""
    import pickle

    class Attack:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "attacked",))

    check(pickle.dumps(Attack()), fitted[1])
    assert not (tmp_path / "attacked").exists()
    pickle.loads(pickle.dumps(Attack()))
    assert (tmp_path / "attacked").exists()  # it would have worked
