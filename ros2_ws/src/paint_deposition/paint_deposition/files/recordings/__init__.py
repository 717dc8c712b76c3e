"""Bags: ROS 1 and rosbag2 in, MCAP runs in and out, recovery of broken ones."""
