"""Links of the Markdown pages lead somewhere, their prose wraps, and their examples name commands and options that exist."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    *ROOT.glob("*.md"),
    *(page for folder in ("docs", "integrations", "lab", "testdata") for page in ROOT.glob(f"{folder}/**/*.md")),
]


def without_code(text: str) -> str:
    return re.sub(r"^ *```.*?^ *```", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, as GitHub makes them, and those that the page sets itself."""
    text = without_code(page.read_text())
    found = set(re.findall(r'<a id="([^"]+)"', text))
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", words).replace(" ", "-"))
    return found


def test_links_lead_somewhere() -> None:
    broken, count = [], 0
    for page in PAGES:
        for link in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            if re.match(r"[a-z]+:", link):
                continue
            count += 1
            if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
                broken.append(f"{page.relative_to(ROOT)}: {link}")
    assert not broken
    assert count > 200, "the search is broken"


def test_the_summary_lists_every_page_once() -> None:
    source = ROOT / "docs" / "src"
    listed = re.findall(r"\]\(([^)#\s]+\.md)\)", (source / "SUMMARY.md").read_text())
    pages = {page.relative_to(source).as_posix() for page in source.glob("**/*.md")} - {"SUMMARY.md"}
    assert sorted(listed) == sorted(pages)


def test_prose_wraps_at_100_columns() -> None:
    """Tables and pictures, which cannot wrap, excepted."""
    long = [
        f"{page.relative_to(ROOT)}: {line}"
        for page in PAGES
        for line in without_code(page.read_text()).splitlines()
        if len(line) > 100 and not line.lstrip().startswith(("|", "!["))
    ]
    assert not long


# Commands of which each has several.
GROUPS = ("compare", "detector", "edits", "self", "test")
# Options that only other programs give, so that the help does not list them.
HIDDEN = ("--unit", "--ids", "--rank")


def examples() -> Iterator[tuple[Path, list[str]]]:
    """Commands of stonewise in the pages' shell examples, as words."""
    for page in PAGES:
        for block in re.findall(r"^ *```sh\n(.*?)^ *```", page.read_text(), re.DOTALL | re.MULTILINE):
            for line in block.replace("\\\n", " ").splitlines():
                if line.strip().startswith("stonewise "):
                    yield page, line.split("#")[0].split()[1:]


def test_examples_name_commands_and_options_that_exist(
    command: Callable[..., subprocess.CompletedProcess[str]],
) -> None:
    helps: dict[tuple[str, ...], str] = {}
    unknown, count = [], 0
    for page, words in examples():
        depth = 3 if words[:2] == ["test", "experiment"] else 2 if words[0] in GROUPS else 1
        name = tuple(word for word in words[:depth] if not word.startswith("-"))
        if name not in helps:
            helps[name] = command(*name, "--help", expect=None).stdout
        count += 1
        options = [word.split("=")[0] for word in words if word.startswith("--") and word not in HIDDEN]
        if not helps[name] or any(option not in helps[name] for option in options):
            unknown.append(f"{page.relative_to(ROOT)}: stonewise {' '.join(words)}")
    assert not unknown
    assert count > 30, "the search is broken"


def test_every_command_is_on_the_page_of_commands(
    command: Callable[..., subprocess.CompletedProcess[str]],
) -> None:
    listed = command("--help").stdout.split("Options:")[0]
    names = set(re.findall(r"^  ([a-z0-9]+) ", listed, re.MULTILINE))
    page = (ROOT / "docs" / "src" / "commands.md").read_text()
    named = {words.split()[0] for words in re.findall(r"`([a-z][^`]*)`", page)}
    assert len(names) > 12, "the search is broken"
    assert names <= named, f"docs/src/commands.md lacks {sorted(names - named)}"
