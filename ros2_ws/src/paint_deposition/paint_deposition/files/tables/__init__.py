"""Tables of readings, points and poses, as gauges, robots and spreadsheets write them."""
