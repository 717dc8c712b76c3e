"""YAML 1.2 in which a key may not be given twice."""

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from paint_deposition.errors import LONGEST_QUOTED, PaintError
from paint_deposition.files.atomic import MOST_TEXT_MB, read_file


def read_yaml(path: Path, kind: str, refusal: type[PaintError]) -> Any:
    """The one document of a file, which should be a ``kind``.

    Raises ``refusal`` where the file cannot be read, is no YAML, or gives a key twice.
    """
    try:
        text = read_file(path, refusal, MOST_TEXT_MB).decode('utf-8')
        return YAML(typ='safe', pure=True).load(text)
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; give a {kind} YAML') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror})') from None
    except RecursionError:
        raise refusal(f'{path}: its values are nested too deeply; give a {kind} YAML') from None
    except UnicodeDecodeError:
        raise refusal(
            f'{path}: is no text, such as a workbook or a bag; give a {kind} YAML in UTF-8'
        ) from None
    except YAMLError as error:
        mark, problem = getattr(error, 'problem_mark', None), ' '.join(str(error).split())
        if mark is not None:
            problem = str(getattr(error, 'problem', error)).split(' with value')[0]
            problem = f'line {mark.line + 1}: {problem[:LONGEST_QUOTED]}'
        raise refusal(f'{path}: cannot be read as YAML ({problem})') from None
