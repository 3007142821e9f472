"""What a ray or a pixel sees first. Every way of answering gives the same record, `records.Hit`."""
