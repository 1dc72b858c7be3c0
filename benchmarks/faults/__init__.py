"""A campaign of faults against the stack; `python benchmarks/campaign.py --help`."""
