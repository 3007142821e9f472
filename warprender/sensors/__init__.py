"""Cameras and lidars of a simulation: many views of a scene in one launch, read where they were written.

A step writes points and poses on the device, then `update` follows what has moved and draws all views; nothing passes
through the host. Pictures are arrays (V, H, W[, C]) that the next `update` writes over.
"""

from .camera_sensor import CameraSensor
from .lidar import LidarSensor
from .sensor import Images, Sensor

__all__ = ["CameraSensor", "Images", "LidarSensor", "Sensor"]
