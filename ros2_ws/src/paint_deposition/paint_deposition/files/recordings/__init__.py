"""Reading ROS 1 and rosbag2 bags, writing MCAP runs, recovering damaged ones."""
