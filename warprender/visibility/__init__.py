"""What a ray or a pixel sees: one record of a hit for all that follows."""
