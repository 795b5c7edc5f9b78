"""Models from elsewhere, and for elsewhere: MJCF and URDF."""
