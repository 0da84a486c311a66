"""The table of mutations fits the checkout: `make mutants` tries them."""

import re

import pytest

from lab.mutants.table import Mutant, TableError, read_table
from lab.mutants.weave import build, weaves

# Of C++, those that bind least first. What stands in brackets, and the arguments of templates, are gone before.
OPERATORS = [r"[?:]", r"\|\|", r"&&", r"[!=]=", r"[<>]=?", r"[-+]", r"[*/%]"]
BINARY = re.compile(rf"(?<=[\w@])\s*({'|'.join(OPERATORS)})")
DECLARES = re.compile(r"(?:(?:const|auto|static|int|bool|double)\b|[\w:]+(?:<[^;]*>)?\s+[*&]*[a-z]\w*\s*(?:[=({]|;$))")


def outermost(text):
    """What is left with @ for all that stands in brackets."""
    text = re.sub(r"::|->", ".", re.sub(r"(?<=\w)<\w+>", "", text))
    while (less := re.sub(r"\([^()]*\)|\{[^{}]*\}|\[[^][]*\]", "@", text)) != text:
        text = less
    return text


def is_closed(text):
    return not set(outermost(text)) & set("(){}[]")


def binding(operator):
    """How strongly, None if it is none."""
    found = [k for k, pattern in enumerate(OPERATORS) if re.fullmatch(pattern, operator)]
    return found[0] if found else None


def why_no_operand(before, text, after):
    """Why brackets around an expression would change it, or what is around it."""
    outside = outermost(text)
    if not is_closed(text) or set(outside) & set(",;"):
        return "more than one"
    if outside.count("?") != outside.count(":"):
        return "half of a choice"
    if re.match(r"[*/%&|<>=?:]", outside) or re.search(r"[-+*/%&|<>=?:!]\s*$", outside):
        return "an operator at its end"
    if after.startswith((".", "->", "(", "[", "::")) or re.search(r"(?:\.|->|::)$", before):
        return "the beginning or the end of a longer one"
    if re.search(r"\w$", before) and not before.endswith(("return", "else")):
        return "the beginning or the end of a longer one"
    least = min((binding(found) for found in BINARY.findall(outside)), default=len(OPERATORS))
    left = re.search(r"(?:[\w)\]}]\s*)(\|\||&&|[!=<>]=|[-+*/%<>])$", before)
    right = re.match(r"\|\||&&|[!=<>]=|[-+*/%<>](?!=)", after)
    bound = binding(left[1]) if left else -1
    if least < bound or (least == bound and left[1] in "-/%") or (right and least < binding(right[0])):
        return "parted by what is beside it"
    return None


def why_no_statement(before, text):
    """Why it can not stand in braces of its own."""
    if not is_closed(text):
        return "not closed"
    if not before.endswith((";", "{", "}", ")", "else", ":")) or text.startswith("else"):
        return "the end of one"
    if DECLARES.match(text) and not text.startswith("return"):
        return "a declaration, unknown after it"
    return None


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
        text, mutant = one.mutant.source().read_text(), one.mutant
        before, after = re.sub(r"//.*", "", text[: one.start]).rstrip(), text[one.end :].lstrip()
        if mutant.original.endswith(";"):
            assert why_no_statement(before, mutant.original) is None, mutant.name
            assert mutant.mutated.endswith(";") and is_closed(mutant.mutated), mutant.name
        else:
            assert why_no_operand(before, mutant.original, after) is None, mutant.name
            assert why_no_operand("(", mutant.mutated, ")") is None, mutant.name


@pytest.mark.parametrize(("before", "text", "after", "why"), [
    ("return ", "a + b", ";", None),
    ("return ", "a > 0 ? a / b", " : c;", "half of a choice"),
    ("return ", "a > 0 ? a / b : c", ";", None),
    ("return a > 0 ? ", "std::sqrt(b)", " : c;", None),
    ("x = a * ", "b + c", ";", "parted by what is beside it"),
    ("x = ", "a + b", " * c;", "parted by what is beside it"),
    ("x = a - ", "b - c", ";", "parted by what is beside it"),
    ("x = a - ", "b * dot<W>(c, d)", " + e;", None),
    ("x = ", "a && b", " || c;", None),
    ("x = a + ", "* b", ";", "an operator at its end"),
    ("x = ", "a *", " b;", "an operator at its end"),
    ("x = ", "-a * b", ";", None),
    ("x = f(", "a, b", ");", "more than one"),
    ("x = ", "f(a", ");", "more than one"),
    ("x = ", "f", "(a);", "the beginning or the end of a longer one"),
    ("x = ", "a", ".b;", "the beginning or the end of a longer one"),
    ("x = a.", "b", ";", "the beginning or the end of a longer one"),
    ("x = f", "(a + b)", ";", "the beginning or the end of a longer one"),
])  # fmt: skip
def test_half_an_expression_is_seen(before, text, after, why):
    assert why_no_operand(before.rstrip(), text, after.lstrip()) == why


@pytest.mark.parametrize(("before", "text", "why"), [
    ("{", "a = b;", None),
    ("if (a)", "return b;", None),
    ("double", "a = b;", "the end of one"),
    ("}", "else b;", "the end of one"),
    ("{", "const double a = b;", "a declaration, unknown after it"),
    ("{", "std::vector<int> a(b);", "a declaration, unknown after it"),
    ("{", "Vec a;", "a declaration, unknown after it"),
    ("{", "f(a;", "not closed"),
])  # fmt: skip
def test_half_a_statement_is_seen(before, text, why):
    assert why_no_statement(before, text) == why


@pytest.mark.validate
def test_all_that_is_woven_compiles(tmp_path):
    for k, group in enumerate(weaves(read_table())):
        assert build(group, tmp_path / str(k))[1] == {}


@pytest.mark.validate
def test_what_does_not_compile_is_left_out(tmp_path):
    wrong = Mutant("wrong", "bond_table.cpp", "b.k_normal / m.stiffness_ratio", "no_such_name", ("test_bonds.py",))
    right = Mutant("right", "bond_table.cpp", "b.k_normal * b.radius * b.radius / 4", "1.0", ("test_bonds.py",))
    (group,) = weaves([wrong, right])
    engine, refused = build(group, tmp_path)
    assert engine.is_file() and list(refused) == ["wrong"] and "no_such_name" in refused["wrong"]


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
