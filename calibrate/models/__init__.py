"""Forward models, one file a model: from a suspension to what should have been measured on it."""
