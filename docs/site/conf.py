"""Configuration of Sphinx for the site that `docs/site/build.py` prepares."""

import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

from raff2urdf.version import __version__

project = "cinegen"
author = "the cinegen authors"
copyright = "the cinegen authors, MIT licence"
version = release = __version__

sys.path.insert(0, str(Path(__file__).parent))  # names, raff_lexer

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "names"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["attrs_inline", "colon_fence", "dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = ["math"]
myst_html_meta = {"description": "Kinematics of any mechanism with closed loops, in Python"}

default_role = "code"  # docstrings mark names with one backtick
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Bools", "Complex", "Indices", "Integers")}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
add_module_names = False
highlight_language = "text"
suppress_warnings = ["misc.highlighting_failure"]  # excerpts of other people's files

html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"cinegen {version}"
html_favicon = "static/icon.svg"
html_static_path = ["static"]
html_extra_path = ["extra"]
exclude_patterns = ["extra", "templates"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
templates_path = ["templates"]
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5394", "color-brand-content": "#0b5394"},
    "dark_css_variables": {"color-brand-primary": "#7fb7ea", "color-brand-content": "#7fb7ea"},
}
html_copy_source = False
html_show_sphinx = False

_opened: list[str] = []


def _hold_opening(app, what, name, obj, options, lines):
    """Take the first paragraph of a property's docstring away: napoleon would read what stands before a colon as a
    type."""
    _opened.clear()
    if what in ("property", "attribute"):
        count = next((i for i, line in enumerate(lines) if not line), len(lines))
        _opened.extend(lines[:count])
        del lines[:count]


def _return_opening(app, what, name, obj, options, lines):
    lines[:0] = _opened


def _write_math(writer, node):
    """Write an equation as MathML, which browsers draw without a script."""
    is_block = isinstance(node, nodes.math_block)
    writer.body.append(convert(node.astext(), display="block" if is_block else "inline"))
    raise nodes.SkipNode


def _shorten_navigation(app, page, template, context, doctree):
    """Give pages of source code the names of the other pages only: most of the time would go into their contents."""
    if page.startswith(("source/", "_modules/")):
        resolve = context["toctree"]
        context["toctree"] = lambda **options: resolve(**{**options, "maxdepth": 1})


def setup(app):
    """Connect what is above; the docstrings' handlers before and after napoleon, navigation before furo."""
    from raff_lexer import RaffLexer

    app.add_lexer("raff", RaffLexer)
    app.add_html_math_renderer("mathml", (_write_math, None), (_write_math, None))
    app.connect("autodoc-process-docstring", _hold_opening, priority=400)
    app.connect("autodoc-process-docstring", _return_opening, priority=600)
    app.connect("html-page-context", _shorten_navigation, priority=400)
