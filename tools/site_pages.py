"""Pages of the documentation site that are made while it is built (a hook of mkdocs.yml).

- ``api/*.md``: one page a group of `reference_groups`, filled from the doc strings;
- ``commands.md``: what each verb of the command line says of itself;
- the texts beside the code: conventions, architecture, the examples' README, with their links
  turned to the pages of the site;
- under each block of Python what it prints, run while the site is built (`site_outputs`).
"""

from __future__ import annotations

import posixpath
import re
import sys
import types
from pathlib import Path
from typing import TYPE_CHECKING

import flightid

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))  # MkDocs loads a hook by its path alone
from reference_groups import GROUPS, Group
from site_outputs import with_outputs

ROOT = Path(__file__).parent.parent
# Page of the site -> file of the repository that it shows.
TEXTS = {
    "conventions.md": "CONVENTIONS.md",
    "architecture.md": "ARCHITECTURE.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
    "security.md": "SECURITY.md",
}
WIDTH = 96
LINK = re.compile(r"\[(?P<text>[^\]]*)\]\((?!https?://|#)(?P<target>[^)#\s]+)(?P<anchor>#[^)]*)?\)")


def _example_pages() -> dict[str, str]:
    found = sorted((ROOT / "examples").glob("*/README.md"))
    return {f"examples/{path.parent.name}.md": str(path.relative_to(ROOT)) for path in found}


def shown_texts() -> dict[str, str]:
    """Pages that show a file from outside ``docs/``, with that file."""
    return TEXTS | _example_pages()


def _directive(name: str, item: object) -> list[str]:
    """What mkdocstrings is asked for; it would take a module of the same name for a verb."""
    homes = {f"flightid.{name}", f"{flightid._HOMES[name]}.{name}"}
    if isinstance(item, types.ModuleType) or not homes & set(sys.modules):
        return [f"::: flightid.{name}"]
    path = f"{item.__module__}.{getattr(item, '__qualname__', name)}"
    return [f'<a id="flightid.{name}"></a>', "", f"::: {path}"]


def api_page(group: Group, folder: str = "..") -> str:
    """One page of the reference as Markdown for mkdocstrings.

    Parameters
    ----------
    group : Group
        Title, guide and names.
    folder : str
        Way from the page to the root of the docs.

    Returns
    -------
    str
        A heading, a link to the guide, and one directive a name.
    """
    lines = [f"# {group.title}", "", f"In sentences: [the guide]({folder}/{group.guide}).", ""]
    for name in group.names:
        item = getattr(flightid, name)
        lines += [*_directive(name, item), ""]
        if isinstance(item, types.ModuleType):
            listed = ", ".join(f'"{key}"' for key in item.__all__)
            lines[-1:] = ["    options:", f"      members: [{listed}]", ""]
    return "\n".join(lines)


def commands_page() -> str:
    """What ``flightid VERB --help`` prints, verb by verb, as Markdown."""
    import click  # noqa: PLC0415

    from flightid.cli.program import program  # noqa: PLC0415

    lines = ["# Command line", "", "`python -m flightid` does the same.", ""]
    context = click.Context(program, info_name="flightid", terminal_width=WIDTH)
    lines += ["```text", program.get_help(context), "```", ""]
    for verb in program.list_commands(context):
        command = program.get_command(context, verb)
        lines += [f"## flightid {verb}", ""]
        lines += _help_of(command, verb, context)
    return "\n".join(lines)


def _help_of(command: object, name: str, parent: object) -> list[str]:
    import click  # noqa: PLC0415

    if not isinstance(command, click.Command) or not isinstance(parent, click.Context):
        return []
    context = click.Context(command, info_name=name, parent=parent, terminal_width=WIDTH)
    lines = ["```text", command.get_help(context), "```", ""]
    if isinstance(command, click.Group):
        for key in command.list_commands(context):
            inner = command.get_command(context, key)
            lines += [f"### {context.command_path} {key}", "", *_help_of(inner, key, context)]
    return lines


def turned(markdown: str, page: str, texts: dict[str, str]) -> str:
    """Turn links between files of the repository into links between pages of the site.

    Parameters
    ----------
    markdown : str
        Text of the page.
    page : str
        Path of the page below ``docs/``, as the site knows it.
    texts : dict of str to str
        Pages that show a file from outside ``docs/``, with that file.

    Returns
    -------
    str
        The text; of a link to a file that the site has not its words stay.
    """
    shown = {file: name for name, file in texts.items()}
    home = posixpath.dirname(texts.get(page, f"docs/{page}"))
    here = posixpath.dirname(page) or "."

    def replace(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(home, match["target"]))
        if target in shown:
            reached = shown[target]
        elif target.startswith("docs/"):
            reached = target.removeprefix("docs/")
        else:
            return match["text"]
        return f"[{match['text']}]({posixpath.relpath(reached, here)}{match['anchor'] or ''})"

    return LINK.sub(replace, markdown)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the made pages to the site."""
    from mkdocs.structure.files import File  # noqa: PLC0415

    made = {f"api/{key}.md": api_page(group) for key, group in GROUPS.items()}
    made["commands.md"] = commands_page()
    for page, file in shown_texts().items():
        made[page] = (ROOT / file).read_text(encoding="utf-8")
    for path, text in made.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn the links of every page; run the examples of those in ``docs/``."""
    del files
    source = page.file.src_uri
    text = turned(markdown, source, shown_texts())
    is_guide = "/" not in source and source not in TEXTS and source != "commands.md"
    return with_outputs(text, source) if is_guide and config.extra["run_examples"] else text


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Take out the dash that a result without a description would end with."""
    del page, config, files
    return re.sub(r'\s+–\s*<div class="doc-md-description">\s*</div>', "", html)
