"""Integrators: from what is seen to radiance and AOVs. One a file: its kernel factory and its launch function."""
