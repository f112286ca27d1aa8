"""Files of readings as laboratories have them, from bytes to numbers with units.

Each module has one idea: text, rows, delimiter, headings, columns, units, decimals, times, dates,
values.
"""
