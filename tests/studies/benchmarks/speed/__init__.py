"""Speed, memory and compilation, beside LIGGGHTS where it is installed."""
