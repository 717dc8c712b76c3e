"""Logs whose columns have names of a driver's own: which of them are the motion, and their units.

``EGMLogger`` of abb_libegm writes what the robot measured (R_FB), what it planned (R_PL) and what
the sensor asked for (S_REF), in ms, mm and degrees.
"""

from collections.abc import Sequence

from paint_deposition.files.tables.headings import Heading

EGM_LOG = {
    'TIMESTAMP': 'time [ms]',
    **{f'R_FB_POS_{axis}': f'{axis} [mm]' for axis in 'XYZ'},
    **{f'R_FB_QUAT_U{k}': f'q{k + 1}' for k in range(4)},
    **{f'R_FB_POS_RJ{k}': f'J{k} [deg]' for k in range(1, 7)},
}


def translated(headings: Sequence[Heading]) -> tuple[list[Heading], str]:
    """The headings with the usual words and units for a log that is known, and a note; else ''.

    What else such a log holds of the motion has no words left.
    """
    if not {'R_FB_POS_X', 'R_FB_POS_RJ1'} & {heading.text for heading in headings}:
        return list(headings), ''
    usual = []
    for heading in headings:
        if meaning := EGM_LOG.get(heading.text):
            words = Heading.of(meaning)
            heading = Heading(heading.text, words.words, words.unit)
        elif heading.text.startswith(('R_FB_', 'R_PL_', 'S_REF_')):
            heading = Heading(heading.text, ())
        usual.append(heading)
    return usual, 'a log of abb_libegm: what the robot measured (R_FB)'
