"""What users are told of input that cannot be rendered."""


class SceneError(ValueError):
    """A stage, prim or flag that cannot be rendered; the message names it in one line."""
