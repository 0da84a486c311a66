"""`gangue learn-forces`: the law of one's own rock and plate."""

import numpy as np
import pytest

from common.resources import resource
from gangue.__main__ import main
from recognition.stone_forces.forces import load_forces

SCENE = str(resource("scenes") / "small.toml")
LIMITS = ["--radius", "0.02", "0.03", "--speed", "2", "4"]


@pytest.mark.parametrize(("options", "said"), [
    (["--stones", "3"], "--stones 3: must be from 16 to 10000"),
    (["--radius", "0.03", "0.02"], "lower first"),
    (["--out", "law.txt"], "the name must end in .json"),
    (["--out", "mine.json"], "mine.json"),
])
def test_bad_input_is_refused(tmp_path, monkeypatch, capsys, options, said):
    """Nothing is begun; a file of another is not overwritten."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.json").write_text("{}")
    assert main(["learn-forces", SCENE, "--out", "law.json", *LIMITS, *options]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["mine.json"]


@pytest.mark.slow
def test_the_law_of_a_tilted_plate_is_of_speeds_across_it(tmp_path):
    """Elastic spheres on a rigid plate give it 2 m v, v being across."""
    (tmp_path / "tilted.toml").write_text('name = "tilted"\nplate.tilt_deg = 60.0\nbase = "'
                                          f'{resource("scenes") / "hertz_coal.toml"}"\n')
    out = tmp_path / "law.json"
    assert main(["learn-forces", str(tmp_path / "tilted.toml"), "--out", str(out), *LIMITS, "--stones", "16"]) == 0
    law = load_forces(out)
    for material, density in enumerate((1380.0, 2400.0)):
        momentum = 4 / 3 * np.pi * 0.025**3 * density * 3.0
        impulse = np.exp(law.mean(material, np.array(0.025), np.array(3.0))[2])
        assert impulse == pytest.approx(2 * momentum, rel=1e-3)


@pytest.mark.validate
def test_law_of_a_rock_of_ones_own(tmp_path):
    """Sixteen coarse stones of a coal half as dense, with sizes and arrivals of their own: the impulse of a stone is
    between m v and 2 m v, with the density that the scene says; a second call runs nothing and writes the same law."""
    text, coal = (resource("scenes") / name for name in ("small.toml", "materials/coal.toml"))
    (tmp_path / "materials").mkdir()
    light = coal.read_text().replace("density_kg_m3 = 1380", "density_kg_m3 = 690")
    (tmp_path / "materials" / "light.toml").write_text(light)
    own = "\n[scatter]\nradius_factor = { lognormal_cv = 0.15 }\narrival_s = [0.0, 0.005]\n"
    both = 'coal = "coal"\ngangue = "gangue"\n\n[contacts]'
    (tmp_path / "mine.toml").write_text(text.read_text().replace(both, both.replace('"coal"', '"light"')) + own)
    out = tmp_path / "law.json"
    arguments = ["learn-forces", str(tmp_path / "mine.toml"), "--out", str(out), *LIMITS, "--stones", "16"]
    assert main(arguments) == 0
    law, times = load_forces(out), [p.stat().st_mtime for p in (tmp_path / "law").iterdir()]
    assert law.density_kg_m3 == pytest.approx([690, 2400])
    for material, density in enumerate(law.density_kg_m3):
        momentum = 4 / 3 * np.pi * 0.025**3 * density * 3.0
        assert 1.0 < np.exp(law.mean(material, np.array(0.025), np.array(3.0))[2]) / momentum < 2.0
    before = out.read_bytes()
    assert main(arguments) == 0 and out.read_bytes() == before
    assert [p.stat().st_mtime for p in (tmp_path / "law").iterdir()] == times
