"""The table of mutations fits the checkout: `make mutants` tries them."""

import re

import pytest

from lab.mutants.table import Mutant, TableError, read_table
from lab.mutants.weave import weaves


def test_every_mutation_applies_once_and_its_tests_are_there():
    for mutant in read_table():
        text = mutant.source().read_text()
        assert mutant.applied(text) != text, mutant.name
        assert mutant.tests, mutant.name
        for argument in mutant.test_arguments():
            file, _, name = argument.partition("::")
            with open(file) as tests:
                assert not name or f"\ndef {name}(" in tests.read(), f"{mutant.name}: {argument}"


def test_what_is_woven_is_one_expression_or_one_statement():
    """As the compiler sees it: a list of arguments, or the end of a statement without its beginning, is neither."""
    for one in (one for group in weaves(read_table()) for one in group):
        before = re.sub(r"//.*", "", one.mutant.source().read_text()[: one.start]).rstrip()
        text, outside = one.mutant.original, one.mutant.original
        while (inner := re.sub(r"\([^()]*\)|\{[^{}]*\}|\[[^][]*\]", "", outside)) != outside:
            outside = inner
        if text.endswith(";"):
            assert before.endswith((";", "{", "}", ")", "else", ":")) and not text.startswith("else"), one.mutant.name
        else:
            assert not set(outside) & set("(){}[],;"), one.mutant.name


def test_what_does_not_apply_once_is_an_error():
    row = Mutant("missing", "bond_table.cpp", "no such text", "", ("test_bonds.py",))
    with pytest.raises(TableError, match="missing: its original text is 0 times in bond_table.cpp, not once"):
        row.applied(row.source().read_text())
    with pytest.raises(TableError, match="test_nothing.py: 0 files"):
        Mutant("untested", "bond_table.cpp", "", "", ("test_nothing.py",)).test_arguments()


def test_there_are_enough_of_them_and_few_engines_hold_all():
    mutants = read_table()
    assert sum(not mutant.harmless for mutant in mutants) >= 150
    assert len(weaves(mutants)) <= 2
