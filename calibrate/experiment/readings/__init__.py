"""Files of readings as laboratories have them, from bytes to numbers with units.

One idea a file: text, rows, delimiter, headings, columns, units, decimals, times, dates, values.
"""
