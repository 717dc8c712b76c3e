"""Names of files."""

import pytest

from paint_deposition.report.writers.inference import file_name


@pytest.mark.parametrize(
    ('name', 'file'), [('door', 'door'), ('Tür 2/left', 'Tür_2_left'), ('../..', 'experiment')]
)
def test_names_of_experiments_become_names_of_files(name, file):
    assert file_name(name) == file
