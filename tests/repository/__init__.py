"""What the repository promises: README, docs, notebooks, examples, start-up, versions."""
