"""Image files, all by OpenImageIO: 8-bit pictures, Radiance HDR, and EXR with one layer for each output.

Pictures for display (PNG, JPEG, TIFF) hold what usdrecord writes: colour as it comes from the renderer, that
is premultiplied by alpha, through the sRGB curve. PNG calls its colour unassociated, so on an empty
background a viewer darkens the rims of objects; draw a dome light, or take EXR, where premultiplied is the
convention.

EXR keeps every value: floats as 32-bit floats, int32 as 32-bit unsigned integers of the same bits (EXR
knows no signed ones), so -1, "nothing here", is stored as 4294967295 and `read` turns it back. OpenImageIO
takes one type for each part, hence integers go into a second part named "integers".
"""

from .display import COLOR_CORRECTIONS, check_color_correction, display_bytes
from .formats import DISPLAY_FORMATS, LAYERED_FORMATS, LINEAR_FORMATS, check_destination, kept
from .packages import exists, unpacked
from .reading import Picture, PictureHeader, picture_header, read, read_picture
from .writing import write, write_exr, write_png

__all__ = [
    "COLOR_CORRECTIONS",
    "DISPLAY_FORMATS",
    "LAYERED_FORMATS",
    "LINEAR_FORMATS",
    "Picture",
    "PictureHeader",
    "check_color_correction",
    "check_destination",
    "display_bytes",
    "exists",
    "kept",
    "picture_header",
    "read",
    "read_picture",
    "unpacked",
    "write",
    "write_exr",
    "write_png",
]
