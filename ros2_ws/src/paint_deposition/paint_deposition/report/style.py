"""Colours and arrangement that the pictures and the report page share."""

INK = '#1f2933'
MUTED = '#616e7c'
GRID = '#e4e7eb'
BEFORE = '#9aa5b1'
ACCENT = '#00708c'
# Film below, within and above the target band, and bare metal; distinct to the colour-blind too.
BELOW, WITHIN, HIGH, BARE = '#3f6fb0', '#b9dcae', '#e07b1f', '#9e9e9e'
COMPONENTS = ('#d1701f', '#7a5195', '#4c9a2a')
# Models side by side; as many as can be distinguished.
MODELS = (ACCENT, *COMPONENTS, '#b5485f', '#8a7a2b')
# 95 % of normally distributed readings lie within so many standard deviations.
TWO_SIDED_95 = 1.96
