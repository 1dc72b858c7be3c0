"""Links of the pages, their anchors, and the headings that errors point to."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from processes import CHECKOUT, PACKAGE

PAGES = sorted([*CHECKOUT.glob("*.md"), *(CHECKOUT / "docs").glob("*.md")])
POINTER = re.compile(r"\b(docs/[\w/]+\.(?:md|py))(?:#([\w-]+))?")


def headings(page: Path) -> list[str]:
    """Titles of a page's sections, those in code blocks left out."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.findall(r"^#+ (.+)$", text, re.MULTILINE)


def anchor(title: str) -> str:
    """Name under which a heading is linked to."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def broken(page: Path) -> list[str]:
    """Links of a page that lead nowhere in this repository."""
    found = []
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        path, _, section = link.partition("#")
        # What docs/generate.py makes is looked at by `make docs`.
        if "://" in link or path.startswith("generated/"):
            continue
        target = page.parent / path if path else page
        if not target.exists() or (section and section not in map(anchor, headings(target))):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    assert not broken(page)


def test_a_broken_link_is_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One\n\n[a](none.md) [b](#two) [c](#one)\n", encoding="utf-8")
    assert broken(page) == ["none.md", "#two"]


def test_code_and_configuration_point_to_documents_and_headings_that_there_are() -> None:
    texts = [path.read_text(encoding="utf-8") for path in (CHECKOUT / PACKAGE).rglob("*.py")]
    texts += [path.read_text(encoding="utf-8") for path in (CHECKOUT / "config").rglob("*.yaml")]
    pointed = {match for text in texts for match in POINTER.findall(text)}
    assert pointed
    for name, section in pointed:
        page = CHECKOUT / name
        assert page.is_file(), f"{name} is pointed to and not there"
        assert not section or section in map(anchor, headings(page)), f"{name} has no section {section}"
