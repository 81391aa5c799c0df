"""The pages of the checkout's root as pages of the site, with their links: README, ARCHITECTURE and the others."""

from __future__ import annotations

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
MANUAL = ROOT / "resources" / "draglag_resources" / "manual"
PAGES = {"README.md": "index.md", "LICENSE": "LICENSE.md"} | {
    name: name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root, and the manual that the program shows on its Help page, with its pictures."""
    for source, target in PAGES.items():
        text = (ROOT / source).read_text("utf-8").replace("](docs/", "](").replace("](LICENSE)", "](LICENSE.md)")
        files.append(File.generated(config, target, content=text if target != "LICENSE.md" else f"# Licence\n\n{text}"))
    files.append(File.generated(config, "manual.md", content=(MANUAL / "manual.md").read_text("utf-8")))
    for picture in sorted((MANUAL / "pictures").glob("*.png")):
        files.append(File.generated(config, f"pictures/{picture.name}", abs_src_path=str(picture)))
    files.append(File.generated(config, "CITATION.cff", content=(ROOT / "CITATION.cff").read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """A page's text with links to the root's pages, which lie next to it in the site."""
    return markdown.replace("](../ARCHITECTURE.md)", "](ARCHITECTURE.md)").replace(
        "](../SECURITY.md)", "](SECURITY.md)"
    )
