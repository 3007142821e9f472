"""Accuracy against time: how far pictures lie apart, and what each second of rendering buys.

`metrics` compares two pictures. What needs packages beyond warprender's own (FLIP, plots) is imported when it is
asked for; `pip install "warprender[study]"` brings them.
"""
