"""The sources of the engine lie in rooms, whose includes point one way."""

import re

import pytest

from dem.coupling.launch import SOURCES, hash_of_sources

ROOMS = re.search(r"^ROOMS := (.+)$", (SOURCES / "Makefile").read_text(), re.MULTILINE)[1].split()


def test_the_list_of_rooms_is_that_of_the_directories():
    assert sorted(ROOMS) == sorted(place.name for place in SOURCES.iterdir() if place.is_dir())


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_includes_only_from_rooms_before_it(room):
    files = [file for file in (SOURCES / room).iterdir() if file.suffix in (".h", ".cpp")]
    assert 0 < len(files) <= 12
    for file in files:
        for name in re.findall(r'#include "([a-z_]+)/', file.read_text()):
            if name in ROOMS:  # else a header of LIGGGHTS
                assert ROOMS.index(name) <= ROOMS.index(room), f"{file.name} includes from {name}"


def test_an_engine_of_other_sources_has_another_name(tmp_path):
    """Where a file of a room is changed, is named otherwise, or lies in another room."""
    names = set()
    for name, content in [("bonds/a.h", "1"), ("bonds/a.h", "2"), ("bonds/b.h", "1"), ("walls/a.h", "1")]:
        directory = tmp_path / str(len(names))
        (directory / name).parent.mkdir(parents=True)
        (directory / name).write_text(content)
        names.add(hash_of_sources(directory))
    assert len(names) == 4
