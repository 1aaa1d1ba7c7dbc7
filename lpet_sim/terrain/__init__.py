"""Mars-like ground that answers for any patch at any resolution; knows no simulator."""
