"""How Sphinx makes pages of the Markdown files of the repository, each as it is, where it is. `.ci/pages FOLDER` builds them."""

import re
import sys
import tomllib
from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.ext.napoleon import Config, GoogleDocstring

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(HERE))

import flowchart  # noqa: E402
import native  # noqa: E402

native.install(ROOT / "pipelines/python")

project = "Gridweave"
version = release = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
copyright = "the authors of Gridweave, MIT or Apache 2.0"

extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "README"
include_patterns = ["**.md"]
exclude_patterns = ["target", "demo", "out", "**/.*", "**/target"]

# Markdown as a forge shows it.
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]
highlight_language = "text"

default_role = "py:obj"
autoclass_content = "both"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
toc_object_entries_show_parents = "hide"
# The annotation `type` is Python's, and not an attribute of that name, of which there are several.
suppress_warnings = ["ref.python"]
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100

html_theme = "furo"
html_title = f"Gridweave {version}"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sphinx = False

#: Attributes are listed in the description of their class.
DOCSTRINGS = Config(napoleon_use_ivar=True)

#: What stands in the table of contents below a page: captions, and pages with their short titles.
CONTENTS = {
    "README": {
        "Guide": [
            ("Install and start", "self"),
            ("From bags to nav2 and RViz", "/pipelines/WALKTHROUGH"),
            ("Logs and topics", "/pipelines/guide/logs"),
            ("Topics with other names, tags", "/pipelines/guide/topics"),
            ("Map files", "/pipelines/guide/map_files"),
            ("Known starts", "/pipelines/guide/initial_poses"),
            ("Deformed maps", "/pipelines/guide/deformed_maps"),
            ("Not merged: why", "/pipelines/guide/not_merged"),
            ("Live", "/pipelines/guide/live"),
            ("Stages of your own", "/pipelines/guide/own_stages"),
        ],
        "Python": [
            ("Merge from Python", "/pipelines/python/README"),
            ("Stages in Python", "/pipelines/python/STAGES"),
            ("API reference", "/pipelines/guide/pages/python_api"),
        ],
        "Robots": [
            ("ROS 2", "/pipelines/ros/README"),
            ("Several machines", "/pipelines/bridge/README"),
            ("A robot computer", "/pipelines/deploy/README"),
        ],
        "Reference": [
            ("Pipelines and tools", "/pipelines/README"),
            ("Viewers", "/pipelines/viewers/README"),
            ("Changes", "/CHANGELOG"),
            ("Security", "/SECURITY"),
        ],
        "How right it is": [
            ("Benchmarks", "/BENCHMARKS"),
            ("Experiments", "/tests/experiments/README"),
            ("Comparison of methods", "/tests/experiments/COMPARISON"),
        ],
        "Code": [
            ("Contributing", "/CONTRIBUTING"),
            ("Published methods", "/pipelines/examples/published/README"),
        ],
    },
    "CONTRIBUTING": {
        "": [
            ("Stages", "/stages/README"),
            ("Runtime", "/runtime/README"),
            ("Logs", "/logs/README"),
            ("Messages", "/logs/msg/gridweave_msgs/README"),
            ("Fonts", "/logs/fonts/README"),
            ("Tests", "/tests/README"),
            ("Tests of the guide", "/tests/guide/README"),
        ],
    },
}

#: The language of an indented block, by its first word.
LANGUAGES = {word: "bash" for word in ("gridweave", "gridweave-ros", "cargo", "pip", "python", "ros2", "rviz2", "podman", "sudo")}


def add_contents(app, docname, source):
    for caption, pages in CONTENTS.get(docname, {}).items():
        options = [":hidden:"] + ([f":caption: {caption}"] if caption else [])
        source[0] += "\n\n" + "\n".join(["```{toctree}", *options, "", *(f"{title} <{page}>" for title, page in pages), "```", ""])


def set_languages(app, doctree):
    for block in doctree.findall(nodes.literal_block):
        first = block.astext().split(maxsplit=1)[0] if block.astext().strip() else ""
        if block.get("language", "text") in ("text", "default", "none"):
            block["language"] = "toml" if re.match(r"\[\[?\w", first) else LANGUAGES.get(first, "text")


def link_folders(app, doctree):
    """A link to a folder goes to its README; without one, to nothing, as only a forge can show a folder."""
    page = Path(app.env.doc2path(app.env.docname))
    for link in list(doctree.findall(addnodes.pending_xref)):
        if link.get("refdomain") or not (folder := page.parent / link["reftarget"]).is_dir():
            continue
        if (folder / "README.md").exists():
            link["refdomain"], link["reftarget"] = "doc", app.env.path2doc(str((folder / "README.md").resolve()))
            link["reftargetid"] = None
        else:
            link.replace_self(link.children)


def read_arguments(app, what, name, obj, options, lines):
    """The sections `Args`, `Attributes` and `Raises` of docstrings. The comments of attributes have none: there a colon is a colon."""
    if what not in ("attribute", "property", "data", "module"):
        lines[:] = GoogleDocstring(lines, DOCSTRINGS, what=what, name=name, obj=obj, options=options).lines()
        # The name by which numpy documents it.
        lines[:] = [line.replace("numpy._typing._array_like.", "") for line in lines]


def write_index(app, error):
    """The first page is what a server shows of the folder."""
    if error is None and app.builder.format == "html":
        (Path(app.outdir) / "index.html").write_bytes((Path(app.outdir) / "README.html").read_bytes())


def setup(app):
    app.add_directive("mermaid", flowchart.Flowchart)
    app.connect("source-read", add_contents)
    app.connect("doctree-read", set_languages)
    app.connect("doctree-read", link_folders)
    app.connect("autodoc-process-docstring", read_arguments)
    app.connect("build-finished", write_index)
