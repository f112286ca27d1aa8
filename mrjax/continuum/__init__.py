"""The tube in one dimension: Kynch's flux, a compressible bed, and the scheme that solves them."""
