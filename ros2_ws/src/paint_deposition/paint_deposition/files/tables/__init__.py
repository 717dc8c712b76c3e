"""Tables as gauges, measuring robots and spreadsheets write them, brought to one form."""
