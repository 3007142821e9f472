"""Integrators: one transport, one file. `RADIANCE` is the list of those of colour; a new one is a file and a line."""

from . import direct, local, path, whitted

#: `radiance_function(key)` of each transport of colour.
RADIANCE = {
    "local": local.radiance_function,
    "direct": direct.radiance_function,
    "whitted": whitted.radiance_function,
    "path": path.radiance_function,
}
