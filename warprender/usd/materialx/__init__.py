"""MaterialX: `.mtlx` files that a stage refers to, and shading networks of `ND_…` nodes."""
