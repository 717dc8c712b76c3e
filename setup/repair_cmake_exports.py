"""Give the CMake exports of the ROS wheels the paths of this environment.

The wheels carry the paths of the machine that built them, and CMake stops on folders that do not
exist. Does nothing where there are no such exports, and nothing on a second run.
"""

import os
import re
import sys
import sysconfig
from pathlib import Path

# Whole items of a CMake list: an absolute path after a quote or a semicolon.
INCLUDE = re.compile(r'(?<=[";])/[^";]*/include/python3\.\d+(?=[";])')
SITE_PACKAGES = re.compile(r'(?<=[";])/[^";]*/lib/python3\.\d+/site-packages(?=[/";])')


def repaired(text: str) -> str:
    """The export with interpreter paths replaced by those of the running interpreter."""
    text = INCLUDE.sub(lambda _: sysconfig.get_path('include'), text)
    return SITE_PACKAGES.sub(lambda _: sysconfig.get_path('purelib'), text)


def replace(path: Path, text: str) -> None:
    """Write to a new file and rename: the old one may be a hard link into uv's cache."""
    new = path.with_name(path.name + '.new')
    new.write_text(text)
    os.replace(new, path)


def main() -> None:
    """Repair every export below the environment's share folder."""
    for path in sorted(Path(sys.prefix, 'share').glob('*/cmake/*.cmake')):
        text = path.read_text()
        new_text = repaired(text)
        if new_text != text:
            replace(path, new_text)
            print(f'repaired {path}')


if __name__ == '__main__':
    main()
