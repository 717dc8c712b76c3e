"""Layouts of gauges, measuring robots and spreadsheets: rows of data, from which tables are read.

A heading is given by its words, small and without accents, units and marks; '#' is any number. To
add a layout, add a row here and a file to the cases of ``tests/files/tables/test_gauges.py``.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

# Columns of our own; where those of a reading are all there, no other name is looked at.
OWN = {
    'x': 'x_m', 'y': 'y_m', 'z': 'z_m', 'thickness': 'thickness_um', 'point': 'point',
    'group': 'group', 'session': 'session', 'sigma': 'sigma_um',
    'layer': 'layer', 'nx': 'nx', 'ny': 'ny', 'nz': 'nz',
}  # fmt: skip
# The headings of each quantity in any table.
ALIASES = {
    'thickness': (
        'thickness', 'film thickness', 'coating thickness', 'film build', 'film', 'dft',
        'reading', 'value', 'messwert', 'epaisseur', '測定値', '膜厚',
    ),
    'from_left': ('from left', 'left', 'von links', 'links'),
    'height': ('height', 'from bottom', 'hohe', 'hohe von unten', 'hoehe', 'von unten'),
    'point': (
        'point', 'location', 'spot', 'label', 'position', 'name', 'punkt', 'messpunkt',
        'messstelle', 'stelle', 'repere', '箇所名', '測定箇所', 'measuring point',
        'measurement point', 'meas point', 'point no', 'point nr', 'point id', 'pos', 'mp',
        'messpunkt nr', 'punkt nr',
    ),
    'number': ('no', 'nr', '#', 'number', 'nummer', 'id', 'reading no', 'reading number'),
    'row': ('row', 'zeile', 'reihe'),
    'column': ('column', 'col', 'spalte'),
    'group': ('group', 'gruppe'),
    'layer': ('layer', 'coat', 'schicht', 'lackschicht', 'couche'),
    'block': ('block', 'block no', 'block nr'),
    'unit': ('unit', 'units', 'einheit'),
}  # fmt: skip
# Columns side by side that are layers of one film, by the name of the layer.
LAYERS = {
    'e-coat': ('e coat', 'ecoat', 'ktl'),
    'primer': ('primer', 'grundierung'),
    'filler': ('filler', 'fuller', 'surfacer'),
    'base': ('basecoat', 'base coat', 'base', 'basislack'),
    'clear': ('clearcoat', 'clear coat', 'clear', 'klarlack'),
    'top': ('topcoat', 'top coat', 'decklack'),
    'layer': ('layer #', 'schicht #'),
    'total': ('total', 'gesamt', 'gesamtdicke'),
}


@dataclass(frozen=True)
class GaugeFormat:
    """A layout that is known by some of its headings."""

    name: str
    shown_by: tuple[str, ...]  # headings that no other layout has together
    columns: Mapping[str, str] = field(default_factory=dict)  # the heading of a quantity
    unused: tuple[str, ...] = ()  # headings that would be taken for a quantity
    # Headings whose cells say whether there is a reading, each with the words for yes.
    status: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


GOOD = ('', 'ok')
FORMATS = (
    GaugeFormat(
        'coatmaster Flex, CSV or JSON', ('fitstate', 'snrstate', 'evaluatestate'),
        {'thickness': 'thickness', 'point': 'sampleid'}, ('id', 'configid', 'fit', 'snr'),
        {'fitstate': GOOD, 'snrstate': GOOD, 'evaluatestate': GOOD,
         'error': (*GOOD, '0', 'none', 'null', 'no error')},
    ),
    GaugeFormat('BYK auto-chart', ('checkzone', 'no'), {'block': 'checkzone', 'number': 'no'}),
    GaugeFormat('DeFelsko PosiTector', ('reading', 'value'),
                {'number': 'reading', 'thickness': 'value'}),
    GaugeFormat('DeFelsko PosiTector', ('reading', 'thickness'),
                {'number': 'reading', 'thickness': 'thickness'}),
    GaugeFormat('spots of SSPC-PA 2', ('gage #', 'spot avg'), {'thickness': 'gage #'}),
    GaugeFormat('coordinate measuring machine', ('x', 'y', 'z', 'i', 'j', 'k'),
                {'nx': 'i', 'ny': 'j', 'nz': 'k'}),
)  # fmt: skip
UNIT = r'(?P<unit>mils?|thou|µm|μm|um|microns?|mm)'
# Lines without headings, as gauges print or send them, dashes for no reading: the groups are the
# headings.
LINES = {
    'PosiTector, serial': re.compile(
        rf'\x02?\s*(?P<thickness>[\d.,]+(?=[^\d.,]*\s[FN])|-+)\s*{UNIT}?\s*(?P<probe>[FN]\w*)?\s*',
        re.IGNORECASE,
    ),
    'Fischer, printed': re.compile(
        rf'\s*n\.?\s*=\s*(?P<number>\d+)\s+(?P<thickness>[\d.,]+|-+)\s*{UNIT}\s*', re.IGNORECASE
    ),
}
# The files of a folder that are one table, one below the other.
FOLDERS = {'PosiTector batch': ('header.txt', 'readings.txt')}

# Cells with which a gauge says that it has no reading.
NOTHING = re.compile(
    r'[-–—.*]*|n\.?/?a\.?|#n/a|k\.?a\.?|nan|none|null|ol|o\.l\.?|err(or)?', re.IGNORECASE
)
# How a row begins that gauges append.
STATISTIC = re.compile(
    r'(mean|average|avg|mittel\w*|durchschnitt|mw|median|std\w*|sd|stabw\w*|stand\w+|streuung|'
    r'min\w*|max\w*|range|spannweite|cv|vk|cpk?|cmk?|lowest|highest|'
    r'(high|low|upper|lower) limit|coef\w*|vari\w*|statist\w*|number of|count|'
    r'anzahl|sum|total|moyenne|ecart|n|s|x|平均\w*|標準偏差|最大\w*|最小\w*)\b'
)
# What makes a thickness another figure than a reading of it.
NO_READING = {
    'nominal', 'nom', 'soll', 'cad', 'design', 'ziel', 'target', 'min', 'max', 'minimum',
    'maximum', 'std', 'sd', 'sigma', 'streuung', 'toleranz', 'tolerance', 'abweichung',
    'deviation', 'differenz', 'difference', 'nass', 'wet', 'fehler', 'error',
}  # fmt: skip
# Films before anything evaporates, as a comb shows them, and words that end as a thickness does.
WET = re.compile(r'(wet|wft|nass)')
OTHER_DICKEN = ('nass', 'soll', 'ziel', 'mindest', 'blech', 'wand', 'material', 'substrat')
# What a column ends with that holds films where no other does, and what else has a thickness.
FILM_ENDINGS = ('thickness', 'dft', 'film')
OTHER_THICKNESS = {
    'sheet', 'wall', 'material', 'substrate', 'panel', 'plate', 'steel', 'metal', 'glass', 'foil',
}  # fmt: skip
