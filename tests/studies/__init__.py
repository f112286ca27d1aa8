"""Long comparisons with theory, measurements and other codes; each writes a page."""
