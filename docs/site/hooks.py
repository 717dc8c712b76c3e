"""What MkDocs calls while it builds the site.

The pages are plain Markdown with links that work in the repository. Here a link to a file outside
docs/ leads to a page that shows the file, `<!-- generated: NAME -->` is replaced by what the code
says (docs/files.md has it already), and formulas become MathML, so that no script has to be
fetched to show them. The notebook is run, and shown as a page.
"""

import html
import os
import re
import warnings
from pathlib import Path

from generated import commands, effects, messages, nodes, python
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert.exporters import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
LINK = re.compile(r'(?<!!)\[([^\]]*)\]\((?!https?:)([^)#\s]+)(#[^)\s]*)?\)')
GENERATED = re.compile(r'<!-- generated: (\w+) -->')
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
# MkDocs shows all warnings; this library comes with the messages.
warnings.filterwarnings('ignore', category=DeprecationWarning, module='lark')

MAKERS = {
    module.__name__.rpartition('.')[2]: module.text
    for module in (commands, effects, messages, nodes, python)
} | {'covariates': effects.covariates}
LANGUAGES = {'.yaml': 'yaml', '.py': 'python', '.xml': 'xml', '.json': 'json', '.csv': 'text'}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each file of the repository that a page links to, and for the notebook."""
    linked = {
        (DOCS / target).resolve()
        for page in files.documentation_pages()
        for _, target, _ in LINK.findall(page.content_string)
    }
    outside = {path for path in linked if path.is_file() and _uri(path).startswith('source/')}
    for path in sorted(outside):
        text = path.read_text(encoding='utf-8')
        if path.suffix != '.md':
            name = path.relative_to(ROOT)
            language = LANGUAGES.get(path.suffix, 'text')
            text = f'# {path.name}\n\n`{name}` of the repository.\n\n```{language}\n{text}\n```\n'
        files.append(File.generated(config, _uri(path), content=text))
    run_all = MarkdownExporter(preprocessors=[ExecutePreprocessor(kernel_name='python3')])
    text, made = run_all.from_filename(DOCS / 'notebook.ipynb', {'output_files_dir': 'notebook'})
    for name, content in {'notebook.md': text, **made['outputs']}.items():
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Fill in what is generated, and turn links to the repository into links of the site."""
    uri = page.file.src_uri
    folder = ROOT if uri.startswith('source/') else DOCS

    def link(found: re.Match) -> str:
        words, target, heading = found.groups(default='')
        shown = _uri((folder / target).resolve())
        if files.get_file_from_path(shown) is None:
            return words
        return f'[{words}]({os.path.relpath(shown, os.path.dirname(uri))}{heading})'

    # Not in blocks of code.
    parts = re.split(r'(^```.*?^```)', markdown, flags=re.DOTALL | re.MULTILINE)
    markdown = ''.join(LINK.sub(link, p) if not p.startswith('```') else p for p in parts)
    return GENERATED.sub(lambda found: MAKERS.get(found[1], str)(), markdown)


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Write formulas as MathML."""

    def formula(found: re.Match) -> str:
        display = 'block' if found[1] == 'div' else 'inline'
        return convert(html.unescape(found[2]).strip(), display=display)

    return FORMULA.sub(formula, content)


def _uri(path: Path) -> str:
    """The page that shows a file of the repository."""
    if path.is_relative_to(DOCS) and path.suffix in ('.md', '.ipynb'):
        return path.relative_to(DOCS).with_suffix('.md').as_posix()
    name = os.path.relpath(path, ROOT)
    return f'source/{name}' if path.suffix == '.md' else f'source/{name}.md'
