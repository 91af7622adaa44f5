# Settings of Sphinx for the site of documents (host/site/build). The READMEs are its pages.
import os
import re
from typing import Any, List

import torquer

project = "Torquer"
copyright = "2026, the authors of Torquer"
version = release = torquer.__version__
extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc"]
root_doc = "README"
exclude_patterns = ["**/node_modules", "host/site", "**/experts"]
templates_path = ["."]
html_additional_pages = {"index": "start_page.html"}
html_theme = "alabaster"
html_theme_options = {"page_width": "min(1200px, 100%)", "sidebar_width": "260px"}
# Blocks of code without a language are commands and their output.
highlight_language = "none"
html_copy_source = False
# Recipes have single lines of a file, in which a lexer finds no whole command.
suppress_warnings = ["misc.highlighting_failure"]
myst_heading_anchors = 6
breathe_projects = {"torquer": os.path.join(os.environ["TORQUER_SITE"], "xml")}
breathe_default_project = "torquer"
autodoc_member_order = "bysource"
autoclass_content = "both"

# Order of the pages; the others follow.
PAGES = """

```{toctree}
:hidden:
:glob:

first_steps
host/README
host/viewer/README
host/python/README
host/scenes/README
host/scenes/own_vessel
host/devices/README
host/simulator/effects/README
host/simulator/README
host/api/README
python_reference
cpp_reference
**
```
"""
LINK = re.compile(r"(?<!!)\[([^]]*)\]\(([^)#:\s]+)\)")


def read(app: Any, page: str, source: List[str]) -> None:
    """Gives the first page the list of all, and links to folders the text of the folder's name only."""
    folder = os.path.dirname(app.env.doc2path(page))
    source[0] = LINK.sub(
        lambda link: link[1] if os.path.isdir(os.path.join(folder, link[2])) else link[0], source[0]
    )
    if page == root_doc:
        source[0] += PAGES


def plain(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: List[str]) -> None:
    """Docstrings are plain text. Their indented lines are code."""
    was_code = False
    out: List[str] = []
    for line in lines:
        code = line.startswith("    ") or (was_code and not line)
        if code and not was_code:
            out += ["::", ""]
        out.append(line if code else re.sub(r"([\\*`_|])", r"\\\1", line))
        was_code = code
    lines[:] = out


def setup(app: Any) -> None:
    app.connect("source-read", read)
    app.connect("autodoc-process-docstring", plain)
