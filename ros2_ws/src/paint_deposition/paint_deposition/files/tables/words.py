"""The words that the trade writes over its columns and under its tables, in several languages.

Words are kept as ``words_of`` leaves them: small, without accents, one word at a time.
"""

import re
import unicodedata

# Metres in a unit, by the ways to write it.
UNITS_M = {
    **dict.fromkeys(('m', 'metre', 'metres', 'meter', 'meters'), 1.0),
    **dict.fromkeys(('cm', 'centimetre', 'centimeter', 'zentimeter'), 1e-2),
    **dict.fromkeys(('mm', 'millimetre', 'millimetres', 'millimeter', 'millimeters'), 1e-3),
    **dict.fromkeys(('um', 'μm', 'micron', 'microns', 'micrometre', 'micrometer'), 1e-6),
    **dict.fromkeys(('mikron', 'mikrometer', 'micrometres', 'micrometers'), 1e-6),
    **dict.fromkeys(('mil', 'mils', 'thou'), 25.4e-6),
    **dict.fromkeys(('inch', 'inches', 'zoll'), 25.4e-3),
}
# The name of a unit in messages, by its metres.
UNIT_NAMES = {1.0: 'm', 1e-2: 'cm', 1e-3: 'mm', 1e-6: 'µm', 25.4e-6: 'mil', 25.4e-3: 'inch'}
LENGTH_UNITS, FILM_UNITS = (1.0, 1e-2, 1e-3, 25.4e-3), (1e-6, 25.4e-6, 1e-3)

# Parts of words, so that Lackschichtdicke and Trockenschichtdicke are known as well.
THICKNESS_PARTS = (
    'thickness', 'dicke', 'epaisseur', 'spessore', 'espesor', 'espessura', 'dikte', 'tykkelse',
    'tjocklek', 'paksuus', 'grubosc', 'tloustka', 'vastagsag', 'kalinlik', 'толщина', '膜厚',
    '厚度', '두께',
)  # fmt: skip
THICKNESS = {'dft', 'build', 'film', 'filmbuild', 'coating', 'tsd'}
VALUES = {
    'reading', 'readings', 'value', 'values', 'measurement', 'measured', 'result', 'wert', 'werte',
    'messwert', 'messwerte', 'ergebnis', 'mesure', 'mesures', 'valeur', 'misura', 'lettura',
    'valore', 'medida', 'lectura', 'valor', 'meting', 'waarde', 'd',
}  # fmt: skip
MEANS = {'mean', 'average', 'avg', 'mittelwert', 'mittel', 'mw', 'moyenne', 'media', 'gemiddelde'}
# Repeats side by side: R1, R2, R3.
REPEAT = re.compile(r'[rmdv]\d+')
# What stands beside a thickness without being one.
LIMITS = {
    'min', 'max', 'minimum', 'maximum', 'std', 'stdev', 'sd', 'stdabw', 'standardabweichung',
    'deviation', 'dev', 'diff', 'difference', 'sigma', 'cov', 'cv', 'target', 'nominal', 'soll',
    'sollwert', 'ziel', 'limit', 'limits', 'lower', 'upper', 'low', 'high', 'tol', 'tolerance',
    'toleranz', 'usl', 'lsl', 'predicted', 'expected', 'spec', 'range', 'uncertainty', 'count',
    'n', 'no', 'nr', 'number', 'type', 'date', 'time', 'ok', 'substrate', 'calibration',
}  # fmt: skip

ACTUAL = {'actual', 'act', 'ist', 'measured', 'meas', 'gemessen', 'istwert'}
NOMINAL = {'nominal', 'nom', 'soll', 'sollwert', 'target', 'cad'}
BESIDE_AXIS = {
    'pos', 'position', 'coord', 'coordinate', 'coordinates', 'koord', 'koordinate', 'axis',
    'achse', 'value', 'wert', 'point', 'punkt',
}  # fmt: skip
NORMAL = {'normal', 'normale', 'n', 'vector', 'vektor'}

FROM_LEFT = {'left', 'links', 'gauche', 'sinistra', 'izquierda', 'esquerda', 'width', 'breite'}
HEIGHT = {
    'height', 'hohe', 'hoehe', 'hauteur', 'altezza', 'altura', 'bottom', 'unten', 'bas', 'basso',
    'abajo', 'lower', 'unterkante',
}  # fmt: skip
OTHER_SIDE = {'right', 'rechts', 'droite', 'destra', 'derecha', 'top', 'oben', 'haut', 'alto'}

POINT = {
    'point', 'points', 'punkt', 'messpunkt', 'messpunkte', 'messstelle', 'stelle', 'spot',
    'location', 'messort', 'ort', 'position', 'pos', 'label', 'bezeichnung', 'punto', 'mp', 'pt',
    '点', '测点', '測定点', 'feature', 'merkmal', 'element', 'meetpunt',
}  # fmt: skip
RUNNING_NUMBER = {'no', 'nr', 'num', 'number', 'nummer', 'numero', '#', 'id', 'name', 'n', 'index'}
BESIDE_POINT = RUNNING_NUMBER | VALUES | {
    'of', 'measuring', 'measurement', 'gauge', 'de', 'di', 'data',
}  # fmt: skip
GROUP = {'group', 'gruppe', 'groupe', 'gruppo', 'grupo'}
UNIT = {'unit', 'units', 'einheit', 'einheiten', 'unite', 'unites', 'unita', 'unidad', 'unidades'}

STATISTICS = MEANS | {
    'min', 'max', 'minimum', 'maximum', 'std', 'stdev', 'stddev', 'sd', 'stdabw', 'deviation',
    'standard', 'standardabweichung', 'variation', 'variationskoeffizient', 'coefficient', 'cov',
    'cv', 'range', 'spannweite', 'median', 'count', 'anzahl', 'nombre', 'numero', 'total', 'sum',
    'summe', 'lowest', 'highest', 'low', 'high', 'cp', 'cpk', 'ndft', 'statistics', 'statistik',
    'statistiques', 'statistica', 'ecart', 'type', 'deviazione', 'desviacion', 'estandar',
    'scarto', 'quer', 'hi', 'lo', 'readings', 'messungen', 'kleinster', 'grosster', 'limit',
    'limits', 'usl', 'lsl', 'abw', 'summary',
}  # fmt: skip
BESIDE_STATISTICS = THICKNESS | VALUES | RUNNING_NUMBER | {
    'x', 'of', 'thickness', 'schichtdicke', 'value', 'upper', 'lower', 'dev', 'batch', 'all', 'de',
    'dry',
}  # fmt: skip
STATISTICS_LETTERS = {'n', 's', 'r', 'v', 'x', 'σ', 'μ', 'xq', 'vk', 'q'}


def words_of(text: str) -> list[str]:
    """The words of a text, small and without accents; '#' and CJK runs count as words."""
    text = unicodedata.normalize('NFKC', text).casefold()
    plain = ''.join(c for c in unicodedata.normalize('NFKD', text) if not unicodedata.combining(c))
    return re.findall(r'[^\W_]+|#', plain)


def split_unit(heading: str) -> tuple[list[str], float | None]:
    """The words of a heading and the unit among them in metres: that in brackets, else the last.

    'X [mm]', 'x (mm)', 'x_mm', 'DFT, µm' and 'Schichtdicke in µm' are all understood.
    """
    bracketed = re.search(r'[\[(]([^\])]*)[\])]', heading)
    if bracketed:
        inside = words_of(bracketed[1])
        if len(inside) == 1 and inside[0] in {**UNITS_M, 'in': 0.0}:
            rest = words_of(heading[: bracketed.start()] + ' ' + heading[bracketed.end() :])
            return rest, UNITS_M.get(inside[0], UNITS_M['inch'])
    words = words_of(heading)
    if words and words[-1] in UNITS_M:
        rest = [word for word in words[:-1] if word != 'in']
        return rest, UNITS_M[words[-1]]
    return words, None


def unit_of(text: str) -> float | None:
    """Metres in a unit that stands alone, None where it is no known one."""
    return UNITS_M.get(''.join(words_of(text)), UNITS_M['inch'] if text == 'in' else None)


def is_thickness(words: list[str]) -> bool:
    """Whether words name the thickness of the film."""
    return any(w in THICKNESS or any(part in w for part in THICKNESS_PARTS) for w in words)
