"""ROS 2 nodes: they translate messages, call the core and publish."""
