"""What a release names stands the same everywhere: versions, the change log, decisions, files of code hosts."""

import re
import tomllib

import pytest
import yaml

from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("*.md"))


def test_the_citation_is_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"]
    assert citation["references"][0]["year"] == 2009
    log = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {citation['version']} - {citation['date-released']}" in log


def test_the_change_log_has_the_form_of_keep_a_changelog() -> None:
    log = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## (.+)$", log, flags=re.MULTILINE)
    assert versions[0] == "Unreleased"
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ - \d{4}-\d\d-\d\d", version) for version in versions[1:])
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"^### (.+)$", log, flags=re.MULTILINE)) <= kinds


def test_decisions_are_numbered_and_say_when_to_try_again() -> None:
    assert [int(page.name[:4]) for page in DECISIONS] == list(range(1, len(DECISIONS) + 1))
    for page in DECISIONS:
        text = page.read_text(encoding="utf-8")
        assert text.startswith(f"# {int(page.name[:4])}. ")
        assert re.search(r"^Decided \d{4}-\d\d.*Status: ", text, flags=re.MULTILINE | re.DOTALL)
        assert "Try again only if" in text, page.name


@pytest.mark.parametrize("name", [".pre-commit-config.yaml", "CITATION.cff"])
def test_files_of_tools_are_yaml(name: str) -> None:
    assert isinstance(yaml.safe_load((ROOT / name).read_text(encoding="utf-8")), dict)


def test_templates_have_a_name_and_a_purpose() -> None:
    for page in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md"):
        _, head, _ = page.read_text(encoding="utf-8").split("---\n", 2)
        assert set(yaml.safe_load(head)) == {"name", "about"}


def test_every_extra_of_all_exists_and_every_target_of_make_is_explained() -> None:
    (all_of,) = PROJECT["optional-dependencies"]["all"]
    named = set(re.findall(r"\w+", all_of.partition("[")[2]))
    assert named <= set(PROJECT["optional-dependencies"])
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = set(" ".join(re.findall(r"^\.PHONY: (.+)$", makefile, flags=re.MULTILINE)).split()) - {"clean"}
    explained = set(re.findall(r"\bmake ([\w-]+)", "".join(re.findall(r"^# .*\n", makefile, flags=re.MULTILINE))))
    assert phony <= explained
