"""The tube in one dimension: `column`, Kynch's flux, a compressible bed, and the scheme."""
