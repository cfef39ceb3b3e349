"""What MkDocs calls while it builds: generated pages are added, equations rendered."""

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from api import pages
from configuration import configuration_page, recipes_page
from mathematics import link_readings, render

ROOT = Path(__file__).parents[2]


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the pages that are made from the code and from files beside ``docs/``."""
    generated = {
        "reference/recipes.md": recipes_page(),
        "reference/configuration.md": configuration_page(),
        "changelog.md": (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        **{f"reference/api/{name}": text for name, text in pages().items()},
    }
    for path, text in generated.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let the model's marks, such as [R4], lead to the readings that they name."""
    del config, files
    return link_readings(markdown) if page.file.src_uri == "model.md" else markdown


def on_page_content(html: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Draw a page's equations."""
    del page, config, files
    return render(html)
