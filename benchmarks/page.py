"""Run a benchmark and put what it prints into the page of the documentation where it belongs.

    python -m benchmarks.page diagnosis [ARGUMENTS OF benchmarks.diagnosis]

A page holds the output between `<!-- measured: NAME -->` and `<!-- end -->`, with the command, the
day and the machine. Runs with --quick or --only are only printed.
"""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.kernel import cpu_name

ROOT = Path(__file__).resolve().parents[1]


# What stands before this line is the progress of a benchmark, not its result.
RESULT_BEGINS = '=== side by side\n'


def page_of(name: str, folder: Path) -> Path:
    """The page that has a place for a benchmark."""
    pages = [
        page
        for page in sorted(folder.glob('*.md'))
        if f'<!-- measured: {name} -->' in page.read_text()
    ]
    if len(pages) != 1:
        raise SystemExit(
            f'{len(pages)} pages in {folder} have <!-- measured: {name} -->; give one'
        )
    return pages[0]


def with_output(text: str, name: str, output: str, heading: str) -> str:
    """The text of a page with new output in the place of a benchmark."""
    block = f'<!-- measured: {name} -->\n\n```\n{heading}\n{output.strip()}\n```\n\n<!-- end -->'
    place = rf'<!-- measured: {name} -->.*?<!-- end -->'
    return re.sub(place, lambda _: block, text, flags=re.DOTALL)


def main() -> None:
    """Run, show and keep."""
    name, *arguments = sys.argv[1:]
    page = page_of(name, ROOT / 'docs')
    command = [sys.executable, '-m', f'benchmarks.{name}', *arguments]
    shown = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        for line in running.stdout:
            print(line, end='', flush=True)
            shown.append(line)
    if running.returncode or {'--quick', '--only'} & {*arguments}:
        sys.exit(running.returncode)
    output = ''.join(shown).rpartition(RESULT_BEGINS)[2]
    heading = ' '.join(['benchmarks/' + name + '.py', *arguments])
    heading += f', {time.strftime("%Y-%m-%d")}, {os.cpu_count()} cores, {cpu_name()}'
    page.write_text(with_output(page.read_text(), name, output, heading))
    print(f'written: {page.relative_to(ROOT)}')


if __name__ == '__main__':
    main()
