"""Specimens of one material that differ: the population behind them, and the next one."""
