"""Ways to run: for a time, to rest, in pieces, in ensembles, in processes; failures and cost."""
