"""Links of the Markdown files lead somewhere, and the checker finds those that do not."""

from __future__ import annotations

from pathlib import Path

import links
import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("path", links.markdown_files(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_of_a_document_leads_to_a_file_and_a_heading(path: Path) -> None:
    assert list(links.broken_in_markdown(path)) == []


def test_the_documents_for_readers_are_among_those_that_are_checked() -> None:
    names = {path.relative_to(ROOT).as_posix() for path in links.markdown_files()}
    assert {"README.md", "CONTRIBUTING.md", "SECURITY.md", "docs/architecture.md", "docs/limits.md"} <= names


def test_a_heading_has_the_anchor_of_github() -> None:
    text = "# A `mesh`, closed?\n\n## Same\n## Same\n### [Links](a.md) – and 3/4\n```\n# no heading\n```\n"
    assert links.anchors(text) == {"a-mesh-closed", "same", "same-1", "links--and-34"}


@pytest.mark.parametrize(
    ("link", "found"),
    [
        ("there.md", True),
        ("there.md#a-heading", True),
        ("#own-heading", True),
        ("https://example.com/not-asked", True),
        ("missing.md", False),
        ("there.md#missing", False),
        ("#missing", False),
    ],
)
def test_a_broken_link_of_a_document_is_found(tmp_path: Path, link: str, found: bool) -> None:
    (tmp_path / "there.md").write_text("# A heading\n")
    document = tmp_path / "from.md"
    document.write_text(f"# Own heading\n\nSee [this]({link}), not `[that](nowhere.md)`.\n\n    [code](nowhere.md)\n")
    assert (list(links.broken_in_markdown(document)) == []) == found


@pytest.mark.parametrize(
    ("tag", "found"),
    [
        ('<a href="other.html#part">', True),
        ('<a href="https://example.com">', True),
        ('<a href="missing.html">', False),
        ('<a href="other.html#missing">', False),
        ('<script src="https://example.com/a.js"></script>', False),
        ('<link rel="stylesheet" href="//example.com/a.css">', False),
        ('<img src="missing.png">', False),
    ],
)
def test_a_page_with_a_broken_link_or_a_request_to_another_machine_is_found(
    tmp_path: Path, tag: str, found: bool
) -> None:
    (tmp_path / "other.html").write_text('<p id="part">')
    (tmp_path / "page.html").write_text(tag)
    assert (list(links.broken_in_html(tmp_path)) == []) == found


def test_a_style_that_loads_a_font_from_another_machine_is_found(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text("")
    (tmp_path / "style.css").write_text("@font-face { src: url('https://example.com/font.woff'); }")
    assert len(list(links.broken_in_html(tmp_path))) == 1


def test_a_folder_without_pages_is_an_error(tmp_path: Path) -> None:
    assert list(links.broken_in_html(tmp_path)) != []
