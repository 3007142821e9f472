"""Subdivision surfaces: Catmull-Clark, Loop and bilinear, with points and normals of the limit.

```
surface = Subdivision(cage, level=2)          # connectivity only: reusable while points move
mesh = surface.mesh(points, primvars)
```
"""

from .cage import Cage
from .surface import Subdivision

__all__ = ["Cage", "Subdivision"]
